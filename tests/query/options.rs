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
fn the_command_lines_defaults_are_the_codes() {
    assert_eq!(format!("{:?}", parse(&[]).unwrap()), format!("{:?}", Options::default()));
}

#[test]
fn flags_are_read_and_bounded() {
    let options = parse(&["--answers", "live", "--guidance", "gradual", "--lmm-url", "http://h/v1"]).unwrap();
    assert_eq!((options.answers, options.guidance), (AnswerSource::Live, Guidance::Gradual));
    assert!(parse(&["--sheet-size", "100"]).is_err());
    assert!(parse(&["--answers", "guess"]).is_err());
}

#[test]
fn what_changes_no_answer_is_not_part_of_the_written_options() {
    let options =
        Options { lmm_parallel: 9, max_usd: Some(1.0), lmm_url: Some("http://h".into()), ..Options::default() };
    let written = serde_json::to_value(&options).unwrap();
    assert_eq!(written, serde_json::to_value(Options::default()).unwrap());
}
