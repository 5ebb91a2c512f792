use gprop::materials::MaterialLibrary;

#[test]
fn the_builtin_library_parses() {
    let library = MaterialLibrary::parse_builtin().unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(library.families().len(), 15);
    assert!(library.materials().len() >= 640, "{} materials", library.materials().len());
}
