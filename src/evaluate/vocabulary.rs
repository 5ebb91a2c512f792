//! The label sets of the paper's evaluation: the label in each set for a material of the library or a name in a
//! hand-labelled map.

use std::collections::BTreeMap;

use clap::ValueEnum;
use serde::Serialize;

use super::label_maps::LabelMaps;
use crate::materials::{Label, Labels, MaterialLibrary, fold};
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

/// A name that is not in any label set, material or family, with a hint about where to look.
#[derive(Debug, Clone, PartialEq)]
pub struct UnknownName {
    pub name: String,
    /// Begins with a semicolon; empty if no name is similar.
    pub hint: String,
}

impl Vocabulary {
    fn of(self, labels: &Labels) -> &Label {
        match self {
            Self::Abo => &labels.abo,
            Self::Mvimgnet => &labels.mvimgnet,
        }
    }

    /// The label for a name: a label of this set, a material of the library or one of its families.
    pub fn label<'a>(self, name: &str, library: &'a MaterialLibrary) -> Option<&'a str> {
        let own = library.materials().iter().map(|material| self.of(&material.labels));
        let itself = own.into_iter().find(|label| fold(&label.name) == fold(name));
        let of_material = || library.get(name).map(|material| self.of(&material.labels));
        let of_family = || library.family(name).map(|family| self.of(&family.labels));
        itself.or_else(of_material).or_else(of_family).map(|label| label.name.as_str())
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
                    hint: library.nearest(name).map_or(String::new(), |(material, _)| {
                        format!("; the nearest material is {:?}", material.name)
                    }),
                }),
            })
            .collect()
    }

    /// The label of this set for every label of a field. Answers were checked against the library, so it contains each
    /// material.
    pub fn of_field<'a>(self, field: &MaterialField, library: &'a MaterialLibrary) -> Vec<&'a str> {
        let checked = "answers were checked against the library";
        field.labels.iter().map(|label| self.label(&label.material, library).expect(checked)).collect()
    }
}
