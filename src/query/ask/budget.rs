//! Keeps the cost of the requests so far, plus the highest cost of those in progress, within a budget.
//!
//! The sender of requests opens an [`Entry`] for each of them, retries included, which reserves the most that the
//! request may cost. The entry is closed with the outcome of the request. Anything that the server may have billed
//! counts, an answer that was lost on the way as much as one that arrived; the reservation is released only if the
//! request was certainly not billed.
//!
//! No more requests are sent than were announced. The budget also counts how many in a row brought nothing: a server from
//! which nothing usable comes is not asked on and on.

use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::Serialize;

use super::cost::{Cost, Price, dollars};
use crate::query::recorded::Usage;
use crate::words::output::counted;
use crate::words::progress;

/// The most that a run may spend, and what it has spent.
#[derive(Debug)]
pub struct Budget {
    price: Option<Price>,
    max_usd: Option<f64>,
    books: Mutex<Books>,
}

#[derive(Debug, Default)]
struct Books {
    spent: Spent,
    reserved_usd: f64,
    is_closed: bool,
    /// Requests sent, whether billed or not.
    sent: usize,
    /// The most that may be sent; `None` if there was no announcement.
    announced: Option<usize>,
    /// Requests in a row that ended without a usable reply.
    in_vain: usize,
    /// True once there was a usable reply.
    is_proven: bool,
}

/// The requests sent and their cost.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Spent {
    /// Requests that were billed or may have been.
    pub requests: usize,
    /// The requests among them that brought no usable reply; each counts with the most that it may have cost.
    pub unanswered: usize,
    pub usage: Usage,
    /// By the price table; `None` if it does not have the model.
    pub usd: Option<f64>,
}

impl Spent {
    /// Reports it, with what there is to say about it, if there was any request.
    pub fn tell(&self, about: &str) {
        if self.requests > 0 {
            progress::notice(&format!("asked: {self}{about}"));
        }
    }
}

impl std::fmt::Display for Spent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Usage { input_tokens, output_tokens } = self.usage;
        write!(f, "{}", counted(self.requests, "request"))?;
        if self.unanswered > 0 {
            write!(f, " ({} of them without a usable reply)", self.unanswered)?;
        }
        write!(f, ", {input_tokens} tokens in and {output_tokens} out, {}", dollars(self.usd))
    }
}

/// Why a request may not be sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NotSent {
    #[error("the next request might exceed the budget")]
    Budget,
    #[error("all requests that were announced are sent")]
    Announced,
    #[error("the run sends no more requests")]
    Closed,
}

/// The requests of one question in the budget.
#[derive(Debug, Clone, Copy)]
pub struct Account<'a> {
    budget: &'a Budget,
    /// Cost of one request.
    cost: Cost,
}

/// A request in progress. If it is dropped without being closed, it counts as unanswered.
#[derive(Debug)]
#[must_use]
pub struct Entry<'a> {
    budget: &'a Budget,
    cost: Cost,
    is_open: bool,
}

impl Budget {
    /// A budget of which nothing has been spent.
    pub fn new(price: Option<Price>, max_usd: Option<f64>) -> Self {
        let spent = Spent { usd: price.as_ref().map(|_| 0.0), ..Spent::default() };
        Self { price, max_usd, books: Mutex::new(Books { spent, ..Books::default() }) }
    }

    /// The model's price, if it is known.
    pub fn price(&self) -> Option<&Price> {
        self.price.as_ref()
    }

    /// The budget, if there is one.
    pub fn max_usd(&self) -> Option<f64> {
        self.max_usd
    }

    /// The account of a question whose requests cost `cost` each.
    pub fn account(&self, cost: Cost) -> Account<'_> {
        Account { budget: self, cost }
    }

    /// Permits this many more requests, and no others.
    pub fn announce(&self, requests: usize) {
        let mut books = self.books();
        books.announced = Some(books.sent + requests);
    }

    /// Notes that a reply could be used.
    pub fn note_usable_reply(&self) {
        let mut books = self.books();
        books.in_vain = 0;
        books.is_proven = true;
    }

    /// How many requests in a row ended without a usable reply.
    pub fn in_vain(&self) -> usize {
        self.books().in_vain
    }

    /// True if there was a usable reply.
    pub fn is_proven(&self) -> bool {
        self.books().is_proven
    }

    /// Permits no further request.
    pub fn close(&self) {
        self.books().is_closed = true;
    }

    /// True if no further request may be sent.
    pub fn is_closed(&self) -> bool {
        self.books().is_closed
    }

    /// Requests sent so far, whether billed or not.
    pub fn sent(&self) -> usize {
        self.books().sent
    }

    /// The amount spent so far.
    pub fn spent(&self) -> Spent {
        self.books().spent
    }

    /// True if this much more might exceed the budget; an unknown cost might.
    pub fn might_pass(&self, most_usd: Option<f64>) -> bool {
        self.books().might_pass(self.max_usd, most_usd)
    }

    /// A thread that panicked while it held the lock left the books consistent: every change only sets numbers.
    fn books(&self) -> MutexGuard<'_, Books> {
        self.books.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Books {
    fn might_pass(&self, max_usd: Option<f64>, most_usd: Option<f64>) -> bool {
        let committed = self.spent.usd.unwrap_or(0.0) + self.reserved_usd;
        let fits = |max: f64| most_usd.is_some_and(|most| committed + most <= max);
        max_usd.is_some_and(|max| !fits(max))
    }
}

impl<'a> Account<'a> {
    /// Reserves a request's highest cost.
    ///
    /// # Errors
    /// If it might exceed the budget or was not announced, or the budget is closed.
    pub fn open(&self) -> Result<Entry<'a>, NotSent> {
        let Self { budget, cost } = *self;
        let mut books = budget.books();
        if books.is_closed {
            return Err(NotSent::Closed);
        }
        if books.might_pass(budget.max_usd, cost.most_usd) {
            return Err(NotSent::Budget);
        }
        if books.announced.is_some_and(|announced| books.sent >= announced) {
            return Err(NotSent::Announced);
        }
        books.sent += 1;
        books.reserved_usd += cost.most_usd.unwrap_or(0.0);
        Ok(Entry { budget, cost, is_open: true })
    }

    /// True if no further request may be sent.
    pub fn is_closed(&self) -> bool {
        self.budget.is_closed()
    }
}

impl Entry<'_> {
    /// Closes the entry of a request that was answered. If the server does not report its tokens, it is assumed to have
    /// used as many as it was allowed.
    pub fn answered(mut self, usage: Option<Usage>) {
        self.bill(usage, 0);
    }

    /// Closes the entry of a request that brought nothing usable but may have been billed.
    pub fn unanswered(mut self) {
        self.bill(None, 1);
    }

    /// Closes the entry of a request that was certainly not billed.
    pub fn not_billed(mut self) {
        self.is_open = false;
        let mut books = self.budget.books();
        books.reserved_usd -= self.cost.most_usd.unwrap_or(0.0);
        books.in_vain += 1;
    }

    fn bill(&mut self, usage: Option<Usage>, unanswered: usize) {
        self.is_open = false;
        let Cost { input_tokens, most_output_tokens: output_tokens, most_usd, .. } = self.cost;
        let usage = usage.unwrap_or(Usage { input_tokens, output_tokens });
        let mut books = self.budget.books();
        books.reserved_usd -= most_usd.unwrap_or(0.0);
        books.in_vain += 1;
        books.spent.requests += 1;
        books.spent.unanswered += unanswered;
        books.spent.usage = books.spent.usage.plus(usage);
        if let (Some(usd), Some(price)) = (books.spent.usd.as_mut(), &self.budget.price) {
            *usd += price.usd(usage);
        }
    }
}

impl Drop for Entry<'_> {
    fn drop(&mut self) {
        if self.is_open {
            self.bill(None, 1);
        }
    }
}
