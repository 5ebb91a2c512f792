//! The label sets of the paper's evaluation: the label in each set for a material of the library or a name in a
//! hand-labelled map.

use std::collections::BTreeMap;

use clap::ValueEnum;
use serde::Serialize;

use super::label_maps::LabelMaps;
use crate::materials::{Labels, MaterialLibrary, fold};
use crate::vote::MaterialField;

/// A label set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Vocabulary {
    /// Labels for Amazon Berkeley Objects
    #[default]
    Abo,
    /// Labels for MVImgNet
    Mvimgnet,
}

/// A name that is neither a label of the set nor a material or family that has one, with a hint about where to look.
#[derive(Debug, Clone, PartialEq)]
pub struct UnknownName {
    pub name: String,
    /// Begins with a semicolon; empty if no name is similar.
    pub hint: String,
}

impl Vocabulary {
    /// The label of this set; `None` if there is none, as for many a user's material.
    fn of(self, labels: &Labels) -> Option<&str> {
        let label = match self {
            Self::Abo => &labels.abo,
            Self::Mvimgnet => &labels.mvimgnet,
        };
        Some(label.name.as_str()).filter(|name| !name.is_empty())
    }

    /// The label for a name: a label of this set, a material of the library or one of its families. A material without a
    /// label has that of its family.
    pub fn label<'a>(self, name: &str, library: &'a MaterialLibrary) -> Option<&'a str> {
        let wanted = fold(name);
        let mut own = library.materials().iter().filter_map(|material| self.of(&material.labels));
        let of_family = |family: &str| library.family(family).and_then(|family| self.of(&family.labels));
        let of_material = || {
            let material = library.get(name)?;
            self.of(&material.labels).or_else(|| of_family(&material.family))
        };
        own.find(|label| fold(label) == wanted).or_else(of_material).or_else(|| of_family(name))
    }

    /// The label of every named value of hand-labelled maps, except values named `background`.
    pub fn of_values<'a>(
        self,
        maps: &LabelMaps,
        library: &'a MaterialLibrary,
    ) -> Result<BTreeMap<u16, &'a str>, UnknownName> {
        let named = maps.names.iter().filter(|(_, name)| fold(name) != "background");
        named
            .map(|(value, name)| match self.label(name, library) {
                Some(label) => Ok((*value, label)),
                None => Err(UnknownName {
                    name: name.clone(),
                    hint: match library.nearest(name) {
                        Some((material, _)) if self.label(&material.name, library).is_some() => {
                            format!("; the nearest material is {:?}", material.name)
                        }
                        _ => String::new(),
                    },
                }),
            })
            .collect()
    }

    /// The label of this set for every part of a field; an empty one, which never counts as correct, if neither the
    /// material nor its family has one.
    pub fn of_field<'a>(self, field: &MaterialField, library: &'a MaterialLibrary) -> Vec<&'a str> {
        field.parts.iter().map(|part| self.label(&part.material, library).unwrap_or_default()).collect()
    }
}
