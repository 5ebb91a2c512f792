use gprop::materials::MaterialLibrary;
use gprop::materials::cli;

#[test]
fn the_builtin_library_passes_its_check() {
    let (text, passes) = cli::check_text(MaterialLibrary::builtin(), true);
    println!("{text}");
    assert!(passes, "{text}");
}
