//! How long a server asks to wait before the next request. There is a standard for it (`Retry-After`), but many servers
//! say it in their own way, and some in the body of the error only.

use std::time::{Duration, SystemTime};

use reqwest::StatusCode;
use reqwest::header::HeaderMap;
use serde_json::Value;

use super::body::{documents, sentence};

/// Looks up the value of a header.
type Headers<'a> = dyn Fn(&str) -> Option<String> + 'a;

/// The wait that a server asks for: in the headers, in the body, or, if it counts requests, as the time at which it counts
/// anew.
pub fn asked(status: StatusCode, headers: &HeaderMap, body: &str) -> Option<Duration> {
    let headers = |name: &str| Some(headers.get(name)?.to_str().ok()?.trim().to_owned());
    let documents = documents(body);
    let in_body = || documents.iter().find_map(|document| in_document(document, status));
    let in_words = || sentence(body).and_then(|sentence| in_sentence(&sentence));
    in_headers(&headers).or_else(in_body).or_else(in_words).or_else(|| reset(&headers, status))
}

/// `Retry-After` (seconds or a date), or the milliseconds of OpenAI and Azure.
fn in_headers(headers: &Headers) -> Option<Duration> {
    let milliseconds = ["retry-after-ms", "x-ms-retry-after-ms"].into_iter().find_map(headers);
    if let Some(milliseconds) = milliseconds.and_then(|text| text.parse::<f64>().ok()) {
        return seconds(milliseconds / 1e3);
    }
    let wait = headers("retry-after")?;
    match wait.parse::<f64>() {
        Ok(wait) => seconds(wait),
        Err(_) => httpdate::parse_http_date(&wait).ok()?.duration_since(SystemTime::now()).ok(),
    }
}

/// More seconds than a `Duration` can hold are still a valid request to wait.
fn seconds(seconds: f64) -> Option<Duration> {
    (seconds >= 0.0).then(|| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX))
}

/// The wait in an error's body, at any depth: Google's `retryDelay` (google.rpc.RetryInfo), the headers of the provider
/// that OpenRouter asked, and the body that this provider sent.
fn in_document(value: &Value, status: StatusCode) -> Option<Duration> {
    match value {
        Value::Array(items) => items.iter().find_map(|item| in_document(item, status)),
        Value::Object(fields) => {
            let delay = ["retryDelay", "retry_delay", "retry_after", "retry_after_seconds"];
            if let Some(delay) = delay.into_iter().find_map(|key| delay_of(fields.get(key)?)) {
                return Some(delay);
            }
            let of_headers = fields.get("headers").and_then(Value::as_object).and_then(|headers| {
                let header = |name: &str| {
                    let (_, value) = headers.iter().find(|(key, _)| key.eq_ignore_ascii_case(name))?;
                    Some(value.as_str().map_or_else(|| value.to_string(), str::to_owned))
                };
                in_headers(&header).or_else(|| reset(&header, status))
            });
            of_headers.or_else(|| fields.values().find_map(|field| in_document(field, status)))
        }
        Value::String(text) if text.trim_start().starts_with(['{', '[']) => {
            documents(text).iter().find_map(|document| in_document(document, status))
        }
        _ => None,
    }
}

/// A delay as a number of seconds, as `"39s"`, or as protobuf writes it in JSON.
fn delay_of(value: &Value) -> Option<Duration> {
    match value {
        Value::Number(number) => seconds(number.as_f64()?),
        Value::String(text) => text.parse().ok().and_then(seconds).or_else(|| duration(text)),
        Value::Object(fields) => seconds(fields.get("seconds")?.as_f64()?),
        _ => None,
    }
}

/// The wait in words, such as "Please retry in 39.2s" or "try again in 1m2.5s".
fn in_sentence(sentence: &str) -> Option<Duration> {
    let sentence = sentence.to_lowercase();
    ["retry in ", "try again in ", "retry after "].iter().find_map(|words| {
        let (_, rest) = sentence.split_once(words)?;
        duration(rest)
    })
}

/// A length of time at the beginning of a text, such as `6m0s`, `350ms` or `20 seconds`.
fn duration(text: &str) -> Option<Duration> {
    let mut total = None;
    let mut rest = text;
    loop {
        let (number, after) = split_while(rest.trim_start(), |c| c.is_ascii_digit() || c == '.');
        let (unit, after) = split_while(after.trim_start(), char::is_alphabetic);
        let unit_s = match unit {
            "ms" | "millisecond" | "milliseconds" => 1e-3,
            "s" | "sec" | "secs" | "second" | "seconds" => 1.0,
            "m" | "min" | "mins" | "minute" | "minutes" => 60.0,
            "h" | "hour" | "hours" => 3600.0,
            "d" | "day" | "days" => 86_400.0,
            _ => return total,
        };
        let Some(part) = number.parse::<f64>().ok().and_then(|number| seconds(number * unit_s)) else { return total };
        total = Some(total.unwrap_or(Duration::ZERO).saturating_add(part));
        rest = after;
    }
}

fn split_while(text: &str, belongs: impl Fn(char) -> bool) -> (&str, &str) {
    text.split_at(text.find(|c| !belongs(c)).unwrap_or(text.len()))
}

/// The time until the server counts anew: of the count that is used up, or of the last one to be renewed if the server does
/// not say which. Servers send these headers with other errors too, where they mean nothing.
fn reset(headers: &Headers, status: StatusCode) -> Option<Duration> {
    if status != StatusCode::TOO_MANY_REQUESTS {
        return None;
    }
    let counts = ["", "-requests", "-tokens"];
    let waits = counts.into_iter().filter_map(|of| {
        let left = headers(&format!("x-ratelimit-remaining{of}")).and_then(|left| left.parse::<f64>().ok());
        let wait = until(&headers(&format!("x-ratelimit-reset{of}"))?)?;
        Some((left.is_some_and(|left| left > 0.0), wait))
    });
    let waits: Vec<(bool, Duration)> = waits.collect();
    let used_up = waits.iter().filter(|(is_left, _)| !is_left).map(|(_, wait)| *wait).max();
    used_up.or_else(|| waits.iter().map(|(_, wait)| *wait).max())
}

/// The time until a moment that is given in seconds from now, in seconds or milliseconds since 1970, or as a length of time.
fn until(text: &str) -> Option<Duration> {
    /// Fewer seconds than since 1970, and more than anyone waits.
    const FIRST_SECOND: f64 = 1e9;
    const FIRST_MILLISECOND: f64 = 1e12;
    let Ok(number) = text.parse::<f64>() else { return duration(text) };
    if number < FIRST_SECOND {
        return seconds(number);
    }
    let moment = if number < FIRST_MILLISECOND { number } else { number / 1e3 };
    let moment = SystemTime::UNIX_EPOCH.checked_add(seconds(moment)?)?;
    moment.duration_since(SystemTime::now()).ok()
}

/// True if the server says that a quota per day is used up, for which no wait within a run helps.
pub fn is_per_day(body: &str) -> bool {
    let quotas: Vec<String> = documents(body).iter().flat_map(quotas).collect();
    let names_day = |text: &str| {
        let text: String = text.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
        text.contains("perday") || text.contains("daily")
    };
    if !quotas.is_empty() {
        return quotas.iter().any(|quota| names_day(quota));
    }
    let sentence = sentence(body).unwrap_or_default();
    names_day(&sentence) && !sentence.to_lowercase().contains("per minute")
}

/// The quotas that Google says were exceeded (google.rpc.QuotaFailure).
fn quotas(value: &Value) -> Vec<String> {
    match value {
        Value::Object(fields) => match fields.get("quotaId") {
            Some(id) => vec![id.to_string()],
            None => fields.values().flat_map(quotas).collect(),
        },
        Value::Array(items) => items.iter().flat_map(quotas).collect(),
        _ => Vec::new(),
    }
}
