use gprop::query::ask::budget::{Budget, NotSent, Spent};
use gprop::query::ask::cost::{Cost, ImageTokens, PriceTable};
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
    // 700 characters are 200 tokens, a 512 x 512 picture 255: 455 input tokens at 2.50
    // and 1000 output tokens at 10 dollars per million.
    let cost = Cost::of_request(&[&"x".repeat(700)], (512, 512), 370, 1000, price.as_ref());
    assert_eq!(cost.input_tokens, 455);
    let most = 455.0 * 2.5e-6 + 1000.0 * 10e-6;
    assert!((cost.most_usd.unwrap() - most).abs() < 1e-12);
    let budget = Budget::new(price, Some(2.5 * most));
    let account = budget.account(cost);
    let (first, second) = (account.open().unwrap(), account.open().unwrap());
    assert_eq!(account.open().unwrap_err(), NotSent::Budget, "a third might pass the budget");
    first.answered(Some(Usage { input_tokens: 455, output_tokens: 100 }));
    let third = account.open().expect("the first took less than set aside");
    third.not_billed();
    second.answered(None);
    let spent = budget.spent();
    assert_eq!((spent.requests, spent.unanswered), (2, 0));
    assert_eq!(spent.usage, Usage { input_tokens: 910, output_tokens: 1100 });
    assert!((spent.usd.unwrap() - (910.0 * 2.5e-6 + 1100.0 * 10e-6)).abs() < 1e-12);
}

#[test]
fn what_may_have_been_billed_counts_at_its_most() {
    let price = PriceTable::builtin().price("gpt-4o").cloned();
    let cost = Cost::of_request(&["a question"], (512, 512), 370, 1000, price.as_ref());
    let budget = Budget::new(price, Some(1.5 * cost.most_usd.unwrap()));
    drop(budget.account(cost).open().unwrap());
    let Spent { requests, unanswered, usd, .. } = budget.spent();
    assert_eq!((requests, unanswered), (1, 1));
    assert!((usd.unwrap() - cost.most_usd.unwrap()).abs() < 1e-12);
    assert_eq!(budget.account(cost).open().unwrap_err(), NotSent::Budget);
    budget.close();
    assert_eq!(budget.account(cost).open().unwrap_err(), NotSent::Closed);
}

#[test]
fn a_budget_that_is_no_number_lets_nothing_through() {
    let price = PriceTable::builtin().price("gpt-4o").cloned();
    let cost = Cost::of_request(&["a question"], (512, 512), 370, 1000, price.as_ref());
    for limit in [f64::NAN, f64::NEG_INFINITY, -1.0] {
        let budget = Budget::new(price.clone(), Some(limit));
        assert_eq!(budget.account(cost).open().unwrap_err(), NotSent::Budget, "{limit}");
    }
    // An unknown cost fits no budget.
    let unknown = Cost::of_request(&["a question"], (512, 512), 370, 1000, None);
    assert_eq!(Budget::new(None, Some(9.0)).account(unknown).open().unwrap_err(), NotSent::Budget);
    assert!(Budget::new(None, None).account(unknown).open().is_ok());
}

#[test]
fn prices_with_which_no_budget_can_be_kept_are_refused() {
    let header = "model,input_usd_per_mtok,output_usd_per_mtok,image_tokens,as_of,source\n";
    let rows = ["NaN,2,", "1,inf,", "-1,2,", "1,2,patches 28 100 NaN", "1,2,patches 28 100 -1"];
    for row in rows {
        let table = PriceTable::from_csv(&format!("{header}mine,{row},2026-01-01,x\n"));
        assert!(table.is_err(), "{row}: {table:?}");
    }
}
