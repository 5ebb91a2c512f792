//! What a person writes: `gprop.toml`, scenarios, grippers, PhysGaussian's configurations, price tables, outcomes.

#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let text = String::from_utf8_lossy(bytes);
    let flag = |name: &str, takes_value| gprop::config::Flag { name: name.to_owned(), takes_value };
    let known = [flag("views", true), flag("scale", true), flag("offline", false)];
    let _ = gprop::config::flags_in(&text, std::path::Path::new("gprop.toml"), &known);
    let _ = gprop::simulate::script::Script::from_toml(&text);
    let _ = gprop::grasp::gripper::GripperProfile::from_toml(&text, "fuzz");
    let _ = gprop::simulate::compat::config::Config::from_json(&text);
    let _ = gprop::query::cost::PriceTable::from_csv(&text);
    let _ = serde_json::from_str::<gprop::batch::Outcome>(&text);
    let _ = gprop::evaluate::masks::Reference::from_json(&text);
});
