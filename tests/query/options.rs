use clap::Parser;
use gprop::query::{AnswerSource, Guidance, Options};

#[derive(Parser)]
struct Cli {
    #[command(flatten)]
    options: Options,
}

fn parse(arguments: &[&str]) -> Result<Options, clap::Error> {
    Cli::try_parse_from(std::iter::once(&"gprop").chain(arguments)).map(|cli| cli.options)
}

#[test]
fn flags_are_read_and_bounded() {
    let options = parse(&["--answers", "live", "--guidance", "family-first", "--lmm-url", "http://h/v1"]).unwrap();
    assert_eq!((options.answers, options.guidance), (AnswerSource::Live, Guidance::FamilyFirst));
    assert!(parse(&["--sheet-size", "100"]).is_err());
    assert!(parse(&["--answers", "guess"]).is_err());
}

#[test]
fn a_budget_is_an_amount_of_money() {
    for bad in ["nan", "NaN", "inf", "-inf", "-1", "1e999", "two"] {
        let error = parse(&[&format!("--max-usd={bad}")]).expect_err(bad);
        assert!(error.to_string().contains("US dollars"), "{bad}: {error}");
        assert_eq!(error.exit_code(), 2);
    }
    for (good, usd) in [("0", 0.0), ("2", 2.0), ("0.50", 0.5)] {
        assert_eq!(parse(&["--max-usd", good]).unwrap().max_usd, Some(usd));
    }
}

#[test]
fn what_changes_no_answer_is_not_part_of_the_written_options() {
    let options =
        Options { lmm_parallel: 9, max_usd: Some(1.0), lmm_url: Some("http://h".into()), ..Options::default() };
    let written = serde_json::to_value(&options).unwrap();
    assert_eq!(written, serde_json::to_value(Options::default()).unwrap());
}
