//! The inspection on one screen.

use std::fmt::Write;

use super::{Doubtful, Inspection, ViewFit};
use crate::scene::{Flaw, ForegroundSource, ObjectSource, Up, UpSource, up};
use crate::words::output::{counted, one_line};

/// Maximum number of views listed one by one; the rest are summarised.
const LISTED_VIEWS: usize = 12;

/// Plain text, about 40 lines.
pub fn to_text(inspection: &Inspection) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let mut line = |name: &str, value: String| writeln!(text, "{name:<11} {}", one_line(&value)).unwrap_or_default();
    line("scene", inspection.name.clone());
    for note in &inspection.notes {
        line("", note.clone());
    }
    line("Gaussians", gaussians(inspection));
    let [x, y, z] = inspection.extent.size;
    line("extent", format!("{x:.4} x {y:.4} x {z:.4} scene units (x, y, z), stray Gaussians aside"));
    line("", format!("from {} to {}", corner(inspection.extent.min), corner(inspection.extent.max)));
    line("up", up(inspection));
    line("scale", scale(inspection));
    line("cameras", cameras(inspection));
    if let Some(source) = inspection.foreground {
        line("foreground", foreground(source).to_owned());
    }
    for (name, value) in views(&inspection.views) {
        line(&name, value);
    }
    for warning in &inspection.warnings {
        line("warning", warning.clone());
    }
    for (name, value) in verdict(inspection) {
        line(name, value);
    }
    text
}

fn corner([x, y, z]: [f64; 3]) -> String {
    format!("({x:.4}, {y:.4}, {z:.4})")
}

fn gaussians(inspection: &Inspection) -> String {
    let Inspection { gaussians, object_gaussians, sh_degree, .. } = inspection;
    let shading = if *sh_degree == 0 { "without" } else { "with" };
    let mut text = format!("{gaussians}, {shading} view-dependent colours (spherical harmonics of degree {sh_degree})");
    if inspection.antialiased {
        text.push_str(", antialiased");
    }
    match inspection.object_source {
        ObjectSource::Whole => {}
        ObjectSource::Standing => text.push_str(&format!("; {object_gaussians} of the object on the surface")),
        ObjectSource::Box => text.push_str(&format!("; {object_gaussians} in the box")),
        ObjectSource::Cluster => text.push_str(&format!("; {object_gaussians} in the cluster taken as the object")),
    }
    text
}

fn up(inspection: &Inspection) -> String {
    let Up { direction, source, angle_to_cameras } = inspection.up;
    let found = match source {
        UpSource::Given => "as given",
        UpSource::DataSet => "by the convention of the data or its format",
        UpSource::Support => "at right angles to the surface under the objects",
        UpSource::Cameras => "by the cameras, which are held level",
        UpSource::Assumed => "assumed, since nothing tells; --up decides",
    };
    let mut text = format!("{}: {found}", up::vector(&direction));
    if let Some(angle) = angle_to_cameras {
        text.push_str(&format!("; the cameras suggest {:.1} degrees from it", angle.to_degrees()));
    }
    if !inspection.up.is_z() {
        let [x, y, z] = inspection.upright_size;
        text.push_str(&format!("; with z up, the object is {x:.4} x {y:.4} x {z:.4} scene units"));
    }
    text
}

fn scale(inspection: &Inspection) -> String {
    match &inspection.scale {
        Some(scale) => format!("1 scene unit = {} m: {}", scale.meters_per_unit, scale.provenance),
        None => "unknown; set it with --scale, or run with --known-mass, to get kilograms and newtons".to_owned(),
    }
}

fn cameras(inspection: &Inspection) -> String {
    let Some(cameras) = &inspection.cameras else { return "none".to_owned() };
    let ([width, height], [fx, fy], [near, far]) = (cameras.first_size, cameras.first_focal, cameras.distance);
    let lens = if cameras.distorted { "with lens distortion" } else { "pinhole" };
    let count = cameras.count;
    format!(
        "{count}, the first {width} x {height}, f = {fx:.1} {fy:.1} px, {lens}; {near:.3} to {far:.3} scene units from the object"
    )
}

pub(super) fn foreground(source: ForegroundSource) -> &'static str {
    match source {
        ForegroundSource::Alpha => "the photos' alpha",
        ForegroundSource::Mask => "masks",
        ForegroundSource::Gaussians => "the area that the object's Gaussians cover",
        ForegroundSource::Whole => "the whole photo",
    }
}

fn views(fits: &[ViewFit]) -> Vec<(String, String)> {
    let numbers = |fit: &ViewFit| {
        let overlap = fit.mask_iou.map_or(String::new(), |iou| format!("   outlines overlap by {:.1} %", 100.0 * iou));
        let flaw = fit.flaw.map_or(String::new(), |flaw| format!("   {}", flaw.in_words()));
        format!("{}: PSNR {:.2} dB{overlap}{flaw}", fit.name, fit.psnr_db)
    };
    let mut lines: Vec<(String, String)> = Vec::new();
    for (index, fit) in fits.iter().take(LISTED_VIEWS).enumerate() {
        lines.push((if index == 0 { "views".to_owned() } else { String::new() }, numbers(fit)));
    }
    if fits.len() > LISTED_VIEWS {
        lines.push((String::new(), format!("... and {} more (--json lists all)", fits.len() - LISTED_VIEWS)));
    }
    for flaw in [Flaw::Blurred, Flaw::OverExposed, Flaw::ShowsNothing] {
        let such: Vec<&str> = fits.iter().filter(|fit| fit.flaw == Some(flaw)).map(|fit| fit.name.as_str()).collect();
        if !such.is_empty() {
            let count = counted(such.len(), "photo");
            lines.push((
                "left out".to_owned(),
                format!("{}: {count}, not worked with: {}", flaw.in_words(), such.join(", ")),
            ));
        }
    }
    if !fits.is_empty() {
        let mut sorted: Vec<f64> = fits.iter().map(|fit| fit.psnr_db).collect();
        sorted.sort_by(f64::total_cmp);
        let (low, mid, high) = (sorted[0], sorted[sorted.len() / 2], sorted[sorted.len() - 1]);
        lines.push((
            "PSNR".to_owned(),
            format!(
                "{low:.2} to {high:.2} dB, median {mid:.2} of {}; the higher, the more the splat looks like the photos (on photos of \
                 real scenes, the paper on 3D Gaussian Splatting reports means of 23 to 29 dB)",
                counted(fits.len(), "view")
            ),
        ));
    }
    lines
}

pub(super) fn verdict(inspection: &Inspection) -> Vec<(&'static str, String)> {
    match (inspection.aligned, &inspection.suggestion) {
        (None, _) if inspection.mesh.is_some() => {
            vec![("drawn", "the views are drawn of the mesh and compared with the Gaussians on its surface".to_owned())]
        }
        (None, _) => vec![(
            "",
            "Without photos gprop can only inspect the splat; all commands that run stages, such as `gprop run`, need \
             --render-views N, which renders its own views from it."
                .to_owned(),
        )],
        (Some(true), _) => vec![("aligned", "photos, cameras and Gaussians agree".to_owned())],
        (Some(false), Some(found)) => vec![
            ("NOT ALIGNED", "photos and Gaussians do not line up".to_owned()),
            (
                "try",
                format!(
                    "--align {}   ({}; correlation {:.2} -> {:.2}, PSNR {:.1} -> {:.1} dB)",
                    found.align,
                    found.meaning,
                    found.correlation_before,
                    found.correlation_after,
                    found.psnr_before_db,
                    found.psnr_after_db
                ),
            ),
        ],
        (Some(false), None) => not_aligned(inspection.doubtful.as_ref()),
    }
}

/// The verdict if nothing is suggested.
fn not_aligned(doubtful: Option<&Doubtful>) -> Vec<(&'static str, String)> {
    let tried = match doubtful {
        Some(_) => "neither a usual conversion nor a rotation, shift and scale that were searched for surely fixes it",
        None => "none of the usual conversions fixes it",
    };
    let mut lines = vec![("NOT ALIGNED", format!("photos and Gaussians do not line up, and {tried}"))];
    if let Some(Doubtful { align, reason, .. }) = doubtful {
        lines.push(("doubtful", format!("--align {align}   ({reason})")));
    }
    lines.push((
        "try",
        "the cameras that the splat was trained with (--cameras); for a nerfstudio export, its dataparser_transforms.json \
         beside the splat; for gsplat's trainer, points3D.bin beside COLMAP's cameras (it moves both unless \
         --no-normalize-world-space); or make sure that the splat is of this capture; if you know how the splat was moved, \
         --align sim=..."
            .to_owned(),
    ));
    lines
}
