//! What the model took the objects of a capture for, as names by which users choose one.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::caption;
use crate::scene::ObjectNumber;
use crate::words::output::one_line;
use crate::workdir;

/// The objects that were run or asked about, and what each was taken for, if it was asked about.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Names(BTreeMap<ObjectNumber, Option<String>>);

/// No single object has this name.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{}", self.text())]
pub struct NameError {
    given: String,
    /// Those that it fits; none if it fits no name.
    fitting: Names,
    known: Names,
}

impl Names {
    /// Reads the names in the work folder of a capture.
    pub fn read(work: &Path) -> Self {
        // A work folder of one of the objects lies among those of the others.
        let folders = match work.parent() {
            Some(parent) if number_of(work).is_some() => folders_in(parent),
            _ => folders_in(&workdir::objects_folder(work)),
        };
        Self(folders.into_iter().map(|(number, folder)| (number, caption(&folder))).collect())
    }

    /// The object with this name: of those that are called so, or else have these words in their names, there must be one.
    /// Upper and lower case are the same.
    ///
    /// # Errors
    /// If there is none or several.
    pub fn number_of(&self, given: &str) -> Result<ObjectNumber, NameError> {
        let sought = words(given);
        let fitting = |fits: &dyn Fn(Vec<String>) -> bool| -> Self {
            let fits =
                |(_, name): &(&ObjectNumber, &Option<String>)| name.as_deref().is_some_and(|name| fits(words(name)));
            Self(self.0.iter().filter(fits).map(|(number, name)| (*number, name.clone())).collect())
        };
        let mut found = fitting(&|name| name == sought);
        if found.0.is_empty() && !sought.is_empty() {
            found = fitting(&|name| name.windows(sought.len()).any(|some| some == sought));
        }
        let mut numbers = found.0.keys();
        match (numbers.next(), numbers.next()) {
            (Some(number), None) => Ok(*number),
            _ => Err(NameError { given: given.to_owned(), fitting: found, known: self.clone() }),
        }
    }

    /// `object_1 (mug), object_2`
    fn listed(&self) -> String {
        let one = |(number, name): (&ObjectNumber, &Option<String>)| match name {
            Some(name) => format!("{number} ({})", one_line(name)),
            None => number.to_string(),
        };
        self.0.iter().map(one).collect::<Vec<_>>().join(", ")
    }
}

impl NameError {
    fn text(&self) -> String {
        let given = one_line(&self.given);
        if given.parse::<u64>().is_ok() {
            return format!("there is no object {given}: they are numbered from 1 on, as `gprop objects SCENE` shows");
        }
        if self.known.0.values().all(Option::is_none) {
            return format!(
                "no object is called {given:?}, because none was asked about yet: until then they have only numbers, such as 2 or \
                 object_2, which `gprop objects SCENE` shows"
            );
        }
        match self.fitting.0.len() {
            0 => format!("no object is called {given:?}; there are {}", self.known.listed()),
            _ => format!("{given:?} may be {}; give more of the name, or the number", self.fitting.listed()),
        }
    }
}

/// The words of a name, in lower case.
fn words(name: &str) -> Vec<String> {
    let words = name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_lowercase).collect()
}

/// The work folders of objects in the folder `objects` of a capture.
pub fn folders_in(objects: &Path) -> BTreeMap<ObjectNumber, PathBuf> {
    let entries = std::fs::read_dir(objects).into_iter().flatten().flatten().map(|entry| entry.path());
    let own = entries.filter(|path| workdir::refuse_link(path, workdir::OUT).is_ok());
    own.filter_map(|path| Some((number_of(&path)?, path))).collect()
}

/// The number of the object whose work folder this is.
fn number_of(work: &Path) -> Option<ObjectNumber> {
    let name = work.file_name()?.to_str()?;
    name.parse().ok().filter(|number: &ObjectNumber| number.to_string() == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_no_name() {
        let error = names(&[Some("mug")]).number_of("0").unwrap_err();
        assert!(error.to_string().contains("there is no object 0: they are numbered from 1 on"), "{error}");
    }

    fn names(all: &[Option<&str>]) -> Names {
        Names(ObjectNumber::first(all.len()).zip(all.iter().map(|name| name.map(str::to_owned))).collect())
    }

    #[test]
    fn a_whole_name_or_words_that_one_object_alone_has_choose_it() {
        let table = names(&[Some("Cracker box"), Some("red mug"), Some("Mug"), None, Some("wooden tea-box")]);
        let number_of = |name: &str| table.number_of(name).map(ObjectNumber::get).map_err(|error| error.to_string());
        for (name, number) in [("cracker BOX", 1), ("cracker", 1), ("red", 2), ("mug", 3), ("tea box", 5)] {
            assert_eq!(number_of(name), Ok(number), "{name}");
        }
        let several = number_of("box").unwrap_err();
        assert!(several.contains("may be object_1 (Cracker box), object_5 (wooden tea-box)"), "{several}");
        for unknown in ["bowl", "ug", "", "box cracker", "-"] {
            let error = number_of(unknown).unwrap_err();
            assert!(error.contains("there are object_1 (Cracker box), object_2 (red mug)"), "{error}");
            assert!(error.contains("object_4, object_5"), "{error}");
        }
        let error = names(&[None, None]).number_of("mug").unwrap_err().to_string();
        assert!(error.contains("none was asked about yet") && error.contains("object_2"), "{error}");
    }
}
