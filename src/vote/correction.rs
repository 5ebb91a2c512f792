//! What the user says of a part, which counts for more than what the model answered: `--correct head.material=steel`.
//!
//! A [`Setting`] is parsed from what was typed; those of one part are joined into its [`Correction`], which is applied to the
//! part after the vote. The part keeps what the answers say, so a correction is always shown as one, and without it
//! the next run has the answers again.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::contents::filled;
use super::{Contents, FieldPart};
use crate::materials::MaterialLibrary;
use crate::query::Form;
use crate::units::{Estimate, Range};
use crate::words::part_fit::PartFit;
use crate::words::part_name::part_name;
use crate::words::readable::significant;

/// A quantity that can be corrected: how it may be typed. The report's page judges by it what is typed there.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Quantity {
    pub key: &'static str,
    /// The units that it may have, each with how much of the SI unit one is.
    units: &'static [(&'static str, f64)],
    /// In the SI unit.
    within: Range,
    /// How to type it.
    form: &'static str,
    /// `within`, in words, which the page says of a value beyond it.
    limits: &'static str,
}

/// Thinner than foil, or thicker than a metre, is no wall of an object that a gripper holds.
const WALL: Quantity = Quantity {
    key: "wall",
    units: &[("mm", 1e-3), ("cm", 1e-2), ("m", 1.0)],
    within: Range::new(1e-6, 1.0),
    form: "give the wall's thickness with its unit, such as 3mm or 2-4mm, or none for a solid",
    limits: "a wall is 0.001 mm to 1 m thick",
};
/// From aerogel to osmium, the densest element (22,590 kg/m3).
const DENSITY: Quantity = Quantity {
    key: "density",
    units: &[("kg/m3", 1.0), ("kg/m³", 1.0), ("g/cm3", 1e3), ("g/cm³", 1e3)],
    within: Range::new(1.0, 22_600.0),
    form: "give a density with its unit, such as 2700kg/m3 or 600-700kg/m3",
    limits: "a density is 1 to 22,600 kg/m3",
};
/// As in answers: less than 1 % is empty.
const SHARE: Quantity = Quantity {
    key: "share",
    units: &[("%", 1e-2), ("", 1.0)],
    within: Range::new(0.01, 1.0),
    form: "give the share of the hollow that is filled, such as 80% or 70-90%",
    limits: "a share is 1 to 100 %",
};
pub const QUANTITIES: [Quantity; 3] = [WALL, DENSITY, SHARE];

/// For a part without a wall.
pub const NONE: &str = "none";
/// For a shell without a filling.
pub const EMPTY: &str = "empty";

/// How many materials an error names.
const NEAREST: usize = 5;

/// `PART.KEY=VALUE`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Setting {
    /// All of it, as it was typed.
    typed: String,
    /// The part's id, name or caption.
    part: String,
    correction: Correction,
}

/// What is corrected of a part; the rest is as answered.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(default)]
pub struct Correction {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub caption: Option<String>,
    /// A name or an alias of the library.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Solid, or a wall and how thick.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub form: Option<Form>,
    /// A name of `fillings.csv`, or `empty`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub filling: Option<String>,
    /// The share of the hollow that the filling takes up.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub share: Option<Range>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub density_kg_m3: Option<Range>,
}

/// A correction of a part, and what the answers say instead.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[non_exhaustive]
pub struct Corrected {
    pub to: Correction,
    pub answered: Answered,
}

/// What the answers say of a part that is corrected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Answered {
    pub caption: String,
    /// Name of the library row.
    pub material: String,
    #[serde(flatten)]
    pub form: Form,
    /// Of a shell that is filled, with what.
    pub filling: Option<String>,
    pub density_kg_m3: Estimate,
}

/// Why a part cannot be corrected as the user says.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum CorrectionError {
    #[error("correction {setting}: no part is called {part:?}; give one of these, by its number or name: {parts}")]
    NoSuchPart { setting: String, part: String, parts: String },
    #[error("correction {setting}: {part:?} fits several parts: {parts}; give a number")]
    AmbiguousPart { setting: String, part: String, parts: String },
    #[error("correction {setting}: {problem}")]
    Refused { setting: String, problem: Problem },
}

/// What is wrong with the corrections of a part.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum Problem {
    #[error("the material library has no {name:?}; {}", near(nearest, "gprop materials list"))]
    NoSuchMaterial { name: String, nearest: Vec<String> },
    #[error("no filling is called {name:?}; give one of these: empty, {fillings}")]
    NoSuchFilling { name: String, fillings: String },
    #[error("{part} has no hollow to fill; say how thick its wall is, such as {id}.wall=3mm")]
    NoHollow { part: String, id: u32 },
    #[error("the answers do not say how full {part} is; say how full, such as {id}.share=80%")]
    NoShare { part: String, id: u32 },
    #[error("nothing is known to be in {part}; say what is, such as {id}.filling=water")]
    NothingInside { part: String, id: u32 },
}

fn near(nearest: &[String], all: &str) -> String {
    match nearest {
        [] => format!("`{all}` lists its materials"),
        names => format!("the nearest are {}; `{all}` lists all", names.join("; ")),
    }
}

impl FromStr for Setting {
    type Err = String;

    fn from_str(typed: &str) -> Result<Self, String> {
        let form = "give PART.KEY=VALUE, such as head.material=steel or cup.wall=3mm; KEY is material, wall, filling, share, \
                    density or caption";
        let (place, value) = typed.split_once('=').ok_or(form)?;
        let (part, key) = place.rsplit_once('.').ok_or(form)?;
        let (part, value) = (part.trim(), value.trim());
        if part.is_empty() || value.is_empty() {
            return Err(form.to_owned());
        }
        let mut correction = Correction::default();
        match key.trim() {
            "material" => correction.material = Some(value.to_owned()),
            "caption" => correction.caption = Some(value.to_owned()),
            "filling" => correction.filling = Some(value.to_lowercase()),
            "wall" => correction.form = Some(wall(value)?),
            "share" => correction.share = Some(SHARE.read(value)?),
            "density" => correction.density_kg_m3 = Some(DENSITY.read(value)?),
            _ => return Err(form.to_owned()),
        }
        Ok(Self { typed: typed.to_owned(), part: part.to_owned(), correction })
    }
}

fn wall(value: &str) -> Result<Form, String> {
    if value.eq_ignore_ascii_case(NONE) {
        return Ok(Form::Solid);
    }
    Ok(Form::Shell { wall_thickness_m: WALL.read(value)? })
}

impl Quantity {
    /// A number or two (`2-4`) in one of the units and within the limits.
    fn read(&self, text: &str) -> Result<Range, String> {
        self.range(text).ok_or_else(|| self.form.to_owned())
    }

    fn range(&self, text: &str) -> Option<Range> {
        let in_unit = |(name, unit): &(&str, f64)| Some((text.strip_suffix(name)?.trim(), *unit));
        let (numbers, unit) = self.units.iter().find_map(in_unit)?;
        let number = |text: &str| text.trim().parse::<f64>().ok().map(|number| number * unit);
        let found = match (number(numbers), numbers.split_once('-')) {
            (Some(exact), _) => Range::exactly(exact),
            (None, Some((low, high))) => Range::new(number(low)?, number(high)?),
            (None, None) => return None,
        };
        let Range { low, high } = self.within;
        (low <= found.low && found.low <= found.high && found.high <= high).then_some(found)
    }
}

impl TryFrom<String> for Setting {
    type Error = String;

    fn try_from(typed: String) -> Result<Self, String> {
        typed.parse()
    }
}

impl From<Setting> for String {
    fn from(setting: Setting) -> Self {
        setting.typed
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.typed)
    }
}

impl Setting {
    fn refused(&self, problem: Problem) -> CorrectionError {
        CorrectionError::Refused { setting: self.typed.clone(), problem }
    }
}

impl Problem {
    /// True if the problem is with what this correction says.
    fn is_about(&self, correction: &Correction) -> bool {
        match self {
            Self::NoSuchMaterial { .. } => correction.material.is_some(),
            Self::NoSuchFilling { .. } | Self::NoHollow { .. } | Self::NoShare { .. } | Self::NothingInside { .. } => {
                correction.filling.is_some() || correction.share.is_some()
            }
        }
    }
}

impl Correction {
    /// Each key with its value, such that they can be typed again.
    pub fn settings(&self) -> Vec<(&'static str, String)> {
        // Without the last digits, which conversions of units leave.
        let number = |value: f64| format!("{value:.9e}").parse().unwrap_or(value).to_string();
        let range = |Range { low, high }: Range, factor: f64, unit: &str| {
            let [low, high] = [low, high].map(|end| number(end * factor));
            if low == high { format!("{low}{unit}") } else { format!("{low}-{high}{unit}") }
        };
        let wall = self.form.map(|form| match form {
            Form::Shell { wall_thickness_m } => range(wall_thickness_m, 1e3, "mm"),
            Form::Solid | Form::Mixed => NONE.to_owned(),
        });
        let all = [
            ("caption", self.caption.clone()),
            ("material", self.material.clone()),
            ("wall", wall),
            ("filling", self.filling.clone()),
            ("share", self.share.map(|share| range(share, 1e2, "%"))),
            ("density", self.density_kg_m3.map(|density| range(density, 1.0, "kg/m3"))),
        ];
        all.into_iter().filter_map(|(key, value)| Some((key, value?))).collect()
    }

    /// Both corrections together; if both set something, `later` counts.
    fn then(self, later: Self) -> Self {
        Self {
            caption: later.caption.or(self.caption),
            material: later.material.or(self.material),
            form: later.form.or(self.form),
            filling: later.filling.or(self.filling),
            share: later.share.or(self.share),
            density_kg_m3: later.density_kg_m3.or(self.density_kg_m3),
        }
    }

    /// The part as corrected. A mixed part keeps the density of the whole, unless its density or wall is corrected.
    ///
    /// # Errors
    /// [`Problem`] if the material or filling is not known, or there is no hollow that is filled.
    pub fn applied(&self, answered: &FieldPart, library: &MaterialLibrary) -> Result<FieldPart, Problem> {
        let mut part = self.of_material(answered, library)?;
        if let Some(form) = self.form {
            let material = library.get(&part.material).filter(|_| part.form == Form::Mixed);
            part.density_kg_m3 = material.map_or(part.density_kg_m3, |material| material.density_kg_m3.into());
            part.bulk_reason = None;
            let is_shell = matches!(form, Form::Shell { .. });
            part.inside = is_shell.then(|| part.inside.unwrap_or(Contents::Unknown));
            part.form = form;
        }
        self.fill(&mut part, library)?;
        if let Some(density) = self.density_kg_m3 {
            part.density_kg_m3 = density.into();
        }
        if let Some(caption) = &self.caption {
            part.caption.clone_from(caption);
        }
        let FieldPart { caption, material, form, density_kg_m3, inside, .. } = answered.clone();
        let filling = match inside {
            Some(Contents::Filled(filled)) => Some(filled.filling),
            Some(Contents::Empty) => Some(EMPTY.to_owned()),
            Some(Contents::Unknown) | None => None,
        };
        let answered = Answered { caption, material, form, filling, density_kg_m3 };
        part.corrected = Some(Box::new(Corrected { to: self.clone(), answered }));
        Ok(part)
    }

    fn of_material(&self, part: &FieldPart, library: &MaterialLibrary) -> Result<FieldPart, Problem> {
        let Some(name) = &self.material else { return Ok(part.clone()) };
        let material = library.get(name).ok_or_else(|| no_such_material(name, library))?;
        let FieldPart { caption, form, inside, bulk_reason, .. } = part.clone();
        let of = FieldPart::of(part.id, material);
        let density_kg_m3 = if form == Form::Mixed { part.density_kg_m3 } else { of.density_kg_m3 };
        Ok(FieldPart { caption, form, inside, bulk_reason, density_kg_m3, ..of })
    }

    fn fill(&self, part: &mut FieldPart, library: &MaterialLibrary) -> Result<(), Problem> {
        if self.filling.is_none() && self.share.is_none() {
            return Ok(());
        }
        let (called, id) = (described(part), part.id);
        if !matches!(part.form, Form::Shell { .. }) {
            return Err(Problem::NoHollow { part: called, id });
        }
        let was = match &part.inside {
            Some(Contents::Filled(filled)) => Some(filled),
            _ => None,
        };
        let contents = match (self.filling.as_deref(), was) {
            (Some(EMPTY), _) => Contents::Empty,
            (Some(name), was) => {
                let row = library.filling(name).ok_or_else(|| no_such_filling(name, library))?;
                let share = self.share.map(Into::into).or(was.map(|was| was.share));
                Contents::Filled(filled(row, share.ok_or(Problem::NoShare { part: called, id })?))
            }
            (None, Some(was)) => {
                let share = self.share.map_or(was.share, Into::into);
                Contents::Filled(super::Filled { share, ..was.clone() })
            }
            (None, None) => return Err(Problem::NothingInside { part: called, id }),
        };
        part.inside = Some(contents);
        Ok(())
    }

    /// Whether a way in which the part may be made is one of those that the correction leaves, numbers aside.
    pub fn agrees_with(&self, part: &FieldPart, library: &MaterialLibrary) -> bool {
        let is_material = |name: &String| library.get(name).is_some_and(|material| material.name == part.material);
        let is_form = |form: Form| std::mem::discriminant(&form) == std::mem::discriminant(&part.form);
        let is_filling = |name: &String| match &part.inside {
            Some(Contents::Filled(filled)) => library.filling(name).is_some_and(|row| row.name == filled.filling),
            Some(Contents::Empty) => name == EMPTY,
            Some(Contents::Unknown) | None => false,
        };
        self.material.as_ref().is_none_or(is_material)
            && self.form.is_none_or(is_form)
            && self.filling.as_ref().is_none_or(is_filling)
    }
}

impl fmt::Display for Correction {
    /// As it is typed, without the part.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let range = |Range { low, high }: Range, unit: f64| {
            let [low, high] = [low, high].map(|end| significant(end / unit));
            if low == high { low } else { format!("{low}-{high}") }
        };
        let form = self.form.map(|form| match form {
            Form::Shell { wall_thickness_m } => format!("{} mm", range(wall_thickness_m, 1e-3)),
            Form::Solid | Form::Mixed => NONE.to_owned(),
        });
        let said = [
            ("caption", self.caption.clone()),
            ("material", self.material.clone()),
            ("wall", form),
            ("filling", self.filling.clone()),
            ("share", self.share.map(|share| format!("{} %", range(share, 1e-2)))),
            ("density", self.density_kg_m3.map(|density| format!("{} kg/m3", range(density, 1.0)))),
        ];
        let said = said.into_iter().filter_map(|(key, value)| Some(format!("{key} {}", value?)));
        f.write_str(&said.collect::<Vec<_>>().join(", "))
    }
}

impl fmt::Display for Answered {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let form = match self.form {
            Form::Solid => "solid".to_owned(),
            Form::Mixed => "mixed".to_owned(),
            Form::Shell { wall_thickness_m } => format!("wall {} mm", significant(1e3 * wall_thickness_m.mid())),
        };
        write!(f, "{}, {form}", self.material)
    }
}

impl fmt::Display for Corrected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "corrected: {}; answered: {}", self.to, self.answered)?;
        if let Some(filling) = self.answered.filling.as_ref().filter(|_| self.to.filling.is_some()) {
            write!(f, ", filling {filling}")?;
        }
        if self.to.density_kg_m3.is_some() {
            write!(f, ", {} kg/m3", significant(self.answered.density_kg_m3.mid))?;
        }
        if self.to.caption.is_some() {
            write!(f, ", {}", self.answered.caption)?;
        }
        Ok(())
    }
}

/// Checks that the library has every material that is set, before anything is done.
///
/// # Errors
/// [`CorrectionError::Refused`].
pub fn check_materials(settings: &[Setting], library: &MaterialLibrary) -> Result<(), CorrectionError> {
    settings.iter().try_for_each(|setting| {
        let unknown = setting.correction.material.as_ref().filter(|name| library.get(name).is_none());
        unknown.map_or(Ok(()), |name| Err(setting.refused(no_such_material(name, library))))
    })
}

/// The parts as corrected.
///
/// # Errors
/// [`CorrectionError`] if a part, material or filling is not known.
pub fn corrected(
    parts: &[FieldPart],
    settings: &[Setting],
    library: &MaterialLibrary,
) -> Result<Vec<FieldPart>, CorrectionError> {
    let mut settings_of: Vec<Vec<&Setting>> = vec![Vec::new(); parts.len()];
    for setting in settings {
        settings_of[part_of(setting, parts)?].push(setting);
    }
    let part_as_corrected = |(part, settings): (&FieldPart, &Vec<&Setting>)| {
        let Some(last) = settings.last() else { return Ok(part.clone()) };
        let correction = settings.iter().fold(Correction::default(), |sum, one| sum.then(one.correction.clone()));
        correction.applied(part, library).map_err(|problem| {
            let cause = settings.iter().rfind(|setting| problem.is_about(&setting.correction));
            cause.unwrap_or(last).refused(problem)
        })
    };
    parts.iter().zip(&settings_of).map(part_as_corrected).collect()
}

/// The index of the part that a setting is about.
fn part_of(setting: &Setting, parts: &[FieldPart]) -> Result<usize, CorrectionError> {
    let fit = |part: &FieldPart| {
        let fit = PartFit::new(part.id, &part.caption, &part.material, &setting.part);
        fit.filter(|fit| *fit != PartFit::Mentioned)
    };
    let best = parts.iter().filter_map(fit).min();
    let found: Vec<usize> = (0..parts.len()).filter(|of| best.is_some() && fit(&parts[*of]) == best).collect();
    let list = |of: &[usize]| of.iter().map(|of| described(&parts[*of])).collect::<Vec<_>>().join("; ");
    let (typed, part) = (setting.typed.clone(), setting.part.clone());
    match found[..] {
        [one] => Ok(one),
        [] => {
            let parts = list(&(0..parts.len()).collect::<Vec<_>>());
            Err(CorrectionError::NoSuchPart { setting: typed, part, parts })
        }
        _ => Err(CorrectionError::AmbiguousPart { setting: typed, part, parts: list(&found) }),
    }
}

fn described(part: &FieldPart) -> String {
    format!("{} ({}, {})", part.id, part_name(&part.caption, &part.material), part.material)
}

fn no_such_material(name: &str, library: &MaterialLibrary) -> Problem {
    Problem::NoSuchMaterial { name: name.to_owned(), nearest: library.similar(name, NEAREST) }
}

fn no_such_filling(name: &str, library: &MaterialLibrary) -> Problem {
    let fillings: Vec<&str> = library.fillings().iter().map(|row| row.name.as_str()).collect();
    Problem::NoSuchFilling { name: name.to_owned(), fillings: fillings.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts() -> Vec<FieldPart> {
        let library = MaterialLibrary::builtin();
        let part = |id, caption: &str, material: &str| FieldPart {
            caption: caption.to_owned(),
            ..FieldPart::of(id, library.get(material).unwrap())
        };
        vec![
            part(1, "hammer head that strikes", "steel, medium carbon 1045"),
            part(4, "wooden handle; pale", "ash, white"),
            part(7, "grip of the handle", "rubber band"),
        ]
    }

    fn set(typed: &[&str]) -> Result<Vec<FieldPart>, String> {
        let settings: Vec<Setting> = typed.iter().map(|typed| typed.parse()).collect::<Result<_, _>>()?;
        corrected(&parts(), &settings, MaterialLibrary::builtin()).map_err(|error| error.to_string())
    }

    #[test]
    fn units_are_explicit() {
        let wall = |text: &str| text.parse::<Setting>().map(|setting| setting.correction.form.unwrap());
        let shell = |low, high| Form::Shell { wall_thickness_m: Range::new(low, high) };
        assert_eq!(wall("cup.wall=3mm").unwrap(), shell(0.003, 0.003));
        assert_eq!(wall("cup.wall= 0.2 - 0.4 cm").unwrap(), shell(0.002, 0.004));
        assert_eq!(wall("cup.wall=none").unwrap(), Form::Solid);
        for wrong in ["cup.wall=3", "cup.wall=4-2mm", "cup.wall=2m", "cup.wall=-1mm", "cup.wall=nanmm"] {
            assert!(wall(wrong).unwrap_err().contains("with its unit, such as 3mm"), "{wrong}");
        }
        let density = |text: &str| text.parse::<Setting>().map(|setting| setting.correction.density_kg_m3.unwrap());
        assert_eq!(density("a.b.density=2.7g/cm3").unwrap(), Range::exactly(2700.0));
        assert_eq!(density("2.density=600-700kg/m3").unwrap(), Range::new(600.0, 700.0));
        assert!(density("2.density=2700").is_err());
        let share = |text: &str| text.parse::<Setting>().map(|setting| setting.correction.share.unwrap());
        assert_eq!(share("can.share=80%").unwrap(), share("can.share=0.8").unwrap());
        assert!(share("can.share=80").unwrap_err().contains("such as 80%"));
        for wrong in ["head", "head=steel", "head.colour=red", ".wall=3mm", "head.material="] {
            assert!(wrong.parse::<Setting>().unwrap_err().contains("PART.KEY=VALUE"), "{wrong}");
        }
    }

    #[test]
    fn a_part_is_named_by_its_number_or_name() {
        for name in ["1", "hammer head", "head", "Head"] {
            let parts = set(&[&format!("{name}.material=aluminium 6061-t6")]).unwrap();
            assert_eq!(parts[0].material, "aluminium 6061-t6", "{name}");
            assert!(parts[1..].iter().all(|part| part.corrected.is_none()));
        }
        let unknown = set(&["blade.material=steel"]).unwrap_err();
        assert!(unknown.contains("1 (hammer head, steel") && unknown.contains("4 (wooden handle, ash"), "{unknown}");
        let two = set(&["handle.wall=2mm"]).unwrap_err();
        assert!(two.contains("fits several parts: 4 (") && two.contains("; 7 ("), "{two}");
        let unknown = set(&["head.material=aluminum 6060-t6"]).unwrap_err();
        assert!(unknown.contains("the nearest are aluminium 60"), "{unknown}");
    }

    #[test]
    fn a_correction_keeps_what_it_does_not_say_and_what_was_answered() {
        let parts =
            set(&["head.wall=3mm", "1.filling=water", "1.share=50%", "1.filling=empty", "4.caption=shaft"]).unwrap();
        let [head, shaft, grip] = &parts[..] else { panic!("three parts") };
        assert_eq!(head.inside, Some(Contents::Empty), "the last one counts");
        assert_eq!((&*head.material, &*shaft.caption), ("steel, medium carbon 1045", "shaft"));
        let corrected = head.corrected.as_ref().unwrap();
        assert_eq!(corrected.answered.form, Form::Solid);
        assert_eq!(
            corrected.to_string(),
            "corrected: wall 3 mm, filling empty, share 50 %; answered: steel, medium carbon 1045, solid"
        );
        assert_eq!(grip, &super::tests::parts()[2]);
        assert!(set(&["head.filling=water"]).unwrap_err().contains("1.wall=3mm"));
        assert!(set(&["head.wall=3mm", "head.filling=water"]).unwrap_err().contains("1.share=80%"));
        assert!(set(&["head.wall=3mm", "head.share=80%"]).unwrap_err().contains("1.filling=water"));
        assert!(
            set(&["head.wall=3mm", "head.filling=unobtainium"]).unwrap_err().contains("give one of these: empty, ")
        );
    }

    #[test]
    fn an_error_names_the_setting() {
        let error = |typed: &[&str]| set(typed).unwrap_err();
        assert!(
            error(&["head.wall=3mm", "head.filling=unobtainium"]).contains("correction head.filling=unobtainium: ")
        );
        assert!(error(&["1.material=unobtainium", "4.wall=2mm"]).starts_with("correction 1.material=unobtainium: "));
        let settings = ["1.material=abs", "1.material=unobtainium"].map(|typed| typed.parse::<Setting>().unwrap());
        let unknown = check_materials(&settings, MaterialLibrary::builtin()).unwrap_err().to_string();
        assert!(unknown.starts_with("correction 1.material=unobtainium: the material library has no "), "{unknown}");
    }

    #[test]
    fn what_is_written_for_a_correction_says_the_same_again() {
        let typed =
            ["a.material=ash, white", "a.wall=2.7-4mm", "a.filling=water", "a.share=35%", "a.density=2700kg/m3"];
        let whole = |settings: &[String]| {
            settings.iter().fold(Correction::default(), |sum, typed| {
                sum.then(typed.parse::<Setting>().unwrap_or_else(|error| panic!("{typed}: {error}")).correction)
            })
        };
        let said = whole(&typed.map(str::to_owned));
        let written: Vec<String> = said.settings().into_iter().map(|(key, value)| format!("a.{key}={value}")).collect();
        assert_eq!(written, typed);
        assert_eq!(whole(&["a.wall=none".to_owned()]).settings(), [("wall", "none".to_owned())]);
    }

    #[test]
    fn a_mixed_part_keeps_its_density_until_that_or_its_wall_is_said() {
        let library = MaterialLibrary::builtin();
        let mixed =
            FieldPart { form: Form::Mixed, density_kg_m3: Range::new(1500.0, 1700.0).into(), ..parts().remove(0) };
        let density = |typed: &str| {
            let setting: Setting = typed.parse().unwrap();
            setting.correction.applied(&mixed, library).unwrap().density_kg_m3
        };
        assert_eq!(density("1.material=abs"), mixed.density_kg_m3);
        assert_eq!(density("1.wall=2mm"), library.get(&mixed.material).unwrap().density_kg_m3.into());
        assert_eq!(density("1.density=900kg/m3"), Range::exactly(900.0).into());
    }
}
