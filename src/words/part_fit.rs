//! How well what a user typed fits a part.

use super::part_name::part_name;

/// From the best fit to the worst.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum PartFit {
    Id,
    Caption,
    Name,
    WithinName,
    /// Only its caption or its material mentions the name.
    Mentioned,
}

impl PartFit {
    /// How `name` fits the part with this id, caption and material; `None` if it does not.
    pub fn new(id: u32, caption: &str, material: &str, name: &str) -> Option<Self> {
        let wanted = name.trim().to_lowercase();
        let short = part_name(caption, material).to_lowercase();
        let [caption, material] = [caption, material].map(str::to_lowercase);
        let within = |text: &str| !wanted.is_empty() && text.contains(&wanted);
        let fits = [
            (wanted == id.to_string(), Self::Id),
            (caption == wanted, Self::Caption),
            (short == wanted, Self::Name),
            (within(&short), Self::WithinName),
            (within(&caption) || within(&material), Self::Mentioned),
        ];
        fits.into_iter().find_map(|(fits, fit)| fits.then_some(fit))
    }
}
