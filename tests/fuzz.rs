//! The corpus of the fuzz targets, file by file: whatever a file contains, its reader returns a value or an error.

use std::fs;
use std::path::Path;

use crate::vote::build::Noise;

#[path = "../fuzz/src/lib.rs"]
pub mod targets;

#[test]
fn no_file_of_the_corpus_trips_its_reader() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus");
    for (target, read) in targets::TARGETS {
        let mut files = 0;
        for entry in fs::read_dir(corpus.join(target)).unwrap() {
            let path = entry.unwrap().path();
            // Shown if the reader panics.
            println!("{}", path.display());
            read(&fs::read(&path).unwrap());
            files += 1;
        }
        assert!(files > 0, "{target} has no files");
    }
}

#[test]
fn random_instructions_trip_nothing_on_the_whole_line() {
    let runs = std::env::var("GPROP_MUTANTS").ok().and_then(|runs| runs.parse().ok()).unwrap_or(200);
    for seed in 0..runs {
        let mut noise = Noise(seed);
        let mut bytes = Vec::new();
        for _ in 0..=seed % 6 {
            bytes.extend([(); 4].map(|()| (noise.next() * 256.0) as u8));
            // Any bits, or a number of the size that log scales and coordinates have.
            let bits = (noise.next() * u32::MAX as f32) as u32;
            let value = if noise.next() < 0.3 { f32::from_bits(bits) } else { noise.within(-6.0, 6.0) };
            bytes.extend(value.to_le_bytes());
        }
        // Shown if it panics.
        println!("seed {seed}: {bytes:?}");
        targets::whole_line(&bytes);
    }
}
