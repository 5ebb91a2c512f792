//! The corpus of the fuzz targets, file by file: whatever is in one, its reader ends with a value or an error.

use std::fs;
use std::path::Path;

#[path = "../fuzz/src/lib.rs"]
mod targets;

#[test]
fn no_file_of_the_corpus_trips_its_reader() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus");
    for (target, read) in targets::TARGETS {
        let mut files = 0;
        for entry in fs::read_dir(corpus.join(target)).unwrap() {
            let path = entry.unwrap().path();
            // Shown where the reader panics.
            println!("{}", path.display());
            read(&fs::read(&path).unwrap());
            files += 1;
        }
        assert!(files > 0, "{target} has no files");
    }
}
