use clap::Parser;
use gprop::scene::{self, gaussians::ExtraProperty};
use gprop::vote::raster::{self, RenderOptions};
#[derive(Parser)]
struct C {
    folder: std::path::PathBuf,
    out: std::path::PathBuf,
    #[arg(long, default_value_t = 0)]
    view: usize,
    #[arg(long)]
    room: bool,
    #[command(flatten)]
    o: scene::Options,
}
fn main() {
    let c = C::parse();
    let t = std::time::Instant::now();
    let s = scene::load(&c.folder, &c.o).unwrap_or_else(|e| {
        eprintln!("{e}");
        std::process::exit(1)
    });
    println!(
        "{:?} {} views {} gaussians {} surroundings degree {} scale {:?}",
        t.elapsed(),
        s.views.len(),
        s.gaussians.len(),
        s.surroundings.len(),
        s.gaussians.sh_degree,
        s.scale
    );
    for n in &s.notes {
        println!("note: {n}")
    }
    for n in &s.warnings {
        println!("warning: {n}")
    }
    let t = std::time::Instant::now();
    let chosen = s.chosen_views(&c.o).unwrap();
    println!("chosen {:?} in {:?}", chosen.iter().map(|v| v.name.clone()).collect::<Vec<_>>(), t.elapsed());
    let v = &s.views[c.view];
    let cloud = if c.room { &s.surroundings } else { &s.gaussians };
    let t = std::time::Instant::now();
    let r = raster::render(cloud, &v.camera, &RenderOptions { antialiased: s.antialiased, ..Default::default() });
    println!("rendered in {:?}", t.elapsed());
    let p = v.photo().unwrap();
    let img = r.to_image([1.0; 3]);
    let (w, h) = img.dimensions();
    let mut mse = 0.0;
    for (a, b) in img.pixels().zip(p.rgb.pixels()) {
        for k in 0..3 {
            mse += (a[k] as f64 - b[k] as f64).powi(2)
        }
    }
    println!("psnr {:.2} {:?}", 10.0 * (255.0f64 * 255.0 / (mse / (w * h * 3) as f64)).log10(), p.foreground_source);
    let mut o = image::RgbImage::new(2 * w, h);
    for (x, y, px) in img.enumerate_pixels() {
        o.put_pixel(x, y, image::Rgb([px[0], px[1], px[2]]));
        o.put_pixel(w + x, y, *p.rgb.get_pixel(x, y));
    }
    o.save(&c.out).unwrap();
    let _ = std::marker::PhantomData::<ExtraProperty>;
}
