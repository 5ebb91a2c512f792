//! nerfstudio's transforms.json and 3DGS' cfg_args.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = gprop::scene::cameras::transforms::parse(bytes);
    let text = String::from_utf8_lossy(bytes);
    let _ = gprop::scene::cameras::gaussian_splatting::TrainingArguments::parse(&text);
});
