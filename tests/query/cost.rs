use gprop::query::cost::{Cost, ImageTokens, Ledger, PriceTable};
use gprop::query::recorded::Usage;

#[test]
fn pictures_are_counted_as_the_published_examples() {
    // OpenAI's guide to images: 1024 x 1024 and 2048 x 4096 in tiles; 1024 x 1024 in patches, and one above the cap.
    let tiles = ImageTokens::Tiles { base: 85, tile: 170 };
    assert_eq!(tiles.count((1024, 1024)), 765);
    assert_eq!(tiles.count((2048, 4096)), 1105);
    let patches = ImageTokens::Patches { side: 32, most: 1536, factor: 1.0 };
    assert_eq!(patches.count((1024, 1024)), 1024);
    assert_eq!(patches.count((1800, 2400)), 1536);
}

#[test]
fn prices_are_found_under_dated_and_provider_names_only_for_the_same_model() {
    let prices = PriceTable::builtin();
    let found = |model: &str| prices.price(model).map(|price| price.model.as_str());
    assert_eq!(found("gpt-4o"), Some("gpt-4o"));
    assert_eq!(found("gpt-4o-2024-08-06"), Some("gpt-4o"));
    assert_eq!(found("openai/gpt-4o-mini"), Some("gpt-4o-mini"));
    assert_eq!(found("gpt-4o-audio-preview"), None);
    assert_eq!(found("qwen2.5-vl"), None);
}

#[test]
fn a_users_table_replaces_the_prices_and_its_mistakes_are_named() {
    let header = "model,input_usd_per_mtok,output_usd_per_mtok,image_tokens,as_of,source\n";
    let table = PriceTable::from_csv(&format!("{header}mine,1,2,,2026-01-01,the contract\n")).unwrap();
    let usage = Usage { input_tokens: 1_000_000, output_tokens: 500_000 };
    assert_eq!(table.price("mine").unwrap().usd(usage), 2.0);
    let error = PriceTable::from_csv(&format!("{header}mine,1,2,cubes 3,2026-01-01,x\n")).unwrap_err().to_string();
    assert!(error.contains("cubes 3") && error.contains("tiles"), "{error}");
}

#[test]
fn the_ledger_never_commits_more_than_the_budget() {
    let price = PriceTable::builtin().price("gpt-4o").cloned();
    // 700 characters are 200 tokens, a 512 x 512 picture 255: 455 tokens in at 2.50, 1000 out at 10 a million.
    let cost = Cost::of_request(&[&"x".repeat(700)], (512, 512), 1000, price.as_ref());
    assert_eq!(cost.input_tokens, 455);
    let most = 455.0 * 2.5e-6 + 1000.0 * 10e-6;
    assert!((cost.most_usd.unwrap() - most).abs() < 1e-12);
    let ledger = Ledger::new(price, Some(2.5 * most));
    assert!(ledger.reserve(&cost) && ledger.reserve(&cost));
    assert!(!ledger.reserve(&cost), "a third might pass the budget");
    ledger.settle(&cost, Some(Usage { input_tokens: 455, output_tokens: 100 }));
    assert!(ledger.reserve(&cost), "the first took less than set aside");
    ledger.release(&cost);
    ledger.settle(&cost, None);
    let spent = ledger.spent();
    assert_eq!(spent.requests, 2);
    assert_eq!(spent.usage, Usage { input_tokens: 910, output_tokens: 1100 });
    assert!((spent.usd.unwrap() - (910.0 * 2.5e-6 + 1100.0 * 10e-6)).abs() < 1e-12);
}
