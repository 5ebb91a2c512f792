//! [`MaterialLibrary`]: the rows in their order, and look-up by name.

use std::collections::{HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, OnceLock};

use super::bibliography::{Constituent, Deviation, Evidence, Reference, Rule};
use super::fillings::Filling;
use super::names::{TokenIndex, fold, inverted};
use super::read::{LibraryError, Placed, Table, Tables, read_tables};
use super::{Family, Material};
use crate::files;

macro_rules! builtin_tables {
    ($($file:literal),* $(,)?) => {
        [$(Table {
            name: concat!("materials/", $file),
            text: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/materials/", $file)),
        }),*]
    };
}

/// The built-in tables.
const BUILTIN: [Table<'static>; 23] = builtin_tables![
    "families.csv",
    "bibliography.csv",
    "evidence.csv",
    "rules.csv",
    "reference.csv",
    "constituents.csv",
    "deviations.csv",
    "wood.csv",
    "metal.csv",
    "thermoplastic.csv",
    "thermoset_composite.csv",
    "rubber.csv",
    "foam.csv",
    "fabric.csv",
    "leather.csv",
    "glass.csv",
    "ceramic.csv",
    "stone.csv",
    "concrete.csv",
    "paper.csv",
    "food.csv",
    "granular_soft.csv",
    "fillings.csv",
];

/// Families and materials in the order of the files, with look-up by name.
#[derive(Debug, Clone)]
pub struct MaterialLibrary {
    families: Vec<Family>,
    materials: Vec<Material>,
    fillings: Vec<Filling>,
    pub(super) references: Vec<Reference>,
    pub(super) evidence: Vec<Evidence>,
    pub(super) rules: Vec<Rule>,
    /// Textbook values for the checks; their `entry` is a material's name.
    pub(super) reference: Vec<Evidence>,
    pub(super) constituents: Vec<Constituent>,
    pub(super) deviations: Vec<Deviation>,
    /// Whether it has a user's tables besides the built-in ones.
    pub(super) is_extended: bool,
    /// Folded names, aliases and inverted names.
    by_name: HashMap<String, usize>,
    tokens: OnceLock<TokenIndex>,
}

impl MaterialLibrary {
    /// The built-in library, parsed on first use.
    ///
    /// # Panics
    /// If the built-in tables do not parse, which the tests rule out.
    pub fn builtin() -> &'static Self {
        static LIBRARY: LazyLock<MaterialLibrary> =
            LazyLock::new(|| MaterialLibrary::parse_builtin().unwrap_or_else(|error| panic!("{error}")));
        &LIBRARY
    }

    /// Parses the built-in tables again.
    pub fn parse_builtin() -> Result<Self, LibraryError> {
        let mut library = Self {
            families: Vec::new(),
            materials: Vec::new(),
            fillings: Vec::new(),
            references: Vec::new(),
            evidence: Vec::new(),
            rules: Vec::new(),
            reference: Vec::new(),
            constituents: Vec::new(),
            deviations: Vec::new(),
            is_extended: false,
            by_name: HashMap::new(),
            tokens: OnceLock::new(),
        };
        library.add(read_tables(&BUILTIN)?)?;
        Ok(library)
    }

    /// The built-in library plus a user's: a CSV of materials, or a folder of such CSVs, which may also hold its own
    /// `families.csv`, `fillings.csv` and other tables of the built-in folder.
    ///
    /// A material, family or filling whose name is in the library replaces that row; every other row is added. A reference,
    /// an entry of one or a rule whose name is in the library is refused, unless it is the same row. Files are read in the
    /// order of their names.
    pub fn load(path: &Path) -> Result<Self, LibraryError> {
        let files = csv_files(path)?;
        let mut texts = Vec::with_capacity(files.len());
        for file in &files {
            let text = files::read_to_string(file)
                .map_err(|source| LibraryError::Unreadable { path: file.clone(), source })?;
            texts.push((file.to_string_lossy().into_owned(), text));
        }
        let tables: Vec<Table> = texts.iter().map(|(name, text)| Table { name, text }).collect();
        let tables = read_tables(&tables)?;
        let mut library = Self { is_extended: true, ..Self::builtin().clone() };
        library.add(tables)?;
        Ok(library)
    }

    /// Every material, in the order of the files.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// Every filling, in the order of `fillings.csv`.
    pub fn fillings(&self) -> &[Filling] {
        &self.fillings
    }

    /// The filling with this name, ignoring case, punctuation, and British or American spelling.
    pub fn filling(&self, name: &str) -> Option<&Filling> {
        let wanted = fold(name);
        self.fillings.iter().find(|filling| fold(&filling.name) == wanted)
    }

    /// Every family, in the order of `families.csv`.
    pub fn families(&self) -> &[Family] {
        &self.families
    }

    /// The family with this name, ignoring case and punctuation.
    pub fn family(&self, name: &str) -> Option<&Family> {
        let wanted = fold(name);
        self.families.iter().find(|family| fold(&family.name) == wanted)
    }

    /// The materials of a family, in order.
    pub fn of_family<'a>(&'a self, family: &'a str) -> impl Iterator<Item = &'a Material> {
        self.materials.iter().filter(move |material| material.family == family)
    }

    /// The material with this name or alias, ignoring case, punctuation, and British or American spelling; "white oak"
    /// also matches "oak, white".
    pub fn get(&self, name: &str) -> Option<&Material> {
        self.by_name.get(&fold(name)).map(|row| &self.materials[*row])
    }

    /// The material whose name or alias shares most words with `name`, and the similarity from 0 to 1; `None` if none
    /// shares any. A name that [`get`](Self::get) finds scores 1.
    pub fn nearest(&self, name: &str) -> Option<(&Material, f64)> {
        if let Some(material) = self.get(name) {
            return Some((material, 1.0));
        }
        self.nearest_where(name, |_| true)
    }

    /// The material of `family` whose name or alias shares most words with `name`, and the similarity from 0 to 1; `None`
    /// if none shares any.
    pub fn nearest_of_family(&self, name: &str, family: &str) -> Option<(&Material, f64)> {
        self.nearest_where(name, |material| material.family == family)
    }

    /// The names of the `most` materials whose name or alias shares most words with `name`, the nearest first.
    pub fn similar(&self, name: &str, most: usize) -> Vec<String> {
        let mut found: Vec<String> = Vec::new();
        while found.len() < most
            && let Some((next, _)) = self.nearest_where(name, |material| !found.contains(&material.name))
        {
            found.push(next.name.clone());
        }
        found
    }

    fn nearest_where(&self, name: &str, may_be: impl Fn(&Material) -> bool) -> Option<(&Material, f64)> {
        let tokens = self.tokens.get_or_init(|| self.token_index());
        let (row, score) = tokens.nearest(name, |row| may_be(&self.materials[row]))?;
        Some((&self.materials[row], score))
    }

    /// The references that the sources name.
    pub fn references(&self) -> &[Reference] {
        &self.references
    }

    /// The rule of `rules.csv` with this id.
    pub fn rule(&self, id: &str) -> Option<&Rule> {
        self.rules.iter().find(|rule| rule.id == id)
    }

    /// The library with only those materials for which `keep` is true, and with the families that have any.
    pub fn restricted_to(&self, keep: impl Fn(&Material) -> bool) -> Self {
        let mut library = self.clone();
        let mut new_row = vec![None; self.materials.len()];
        library.materials.clear();
        for (row, material) in self.materials.iter().enumerate().filter(|(_, material)| keep(material)) {
            new_row[row] = Some(library.materials.len());
            library.materials.push(material.clone());
        }
        let materials = &library.materials;
        library.families.retain(|family| materials.iter().any(|material| material.family == family.name));
        let kept = self.by_name.iter().filter_map(|(name, row)| Some((name.clone(), new_row[*row]?)));
        library.by_name = kept.collect();
        // A name that stood for a material that is gone may be that of another one.
        library.index_names(&[]);
        library
    }

    fn token_index(&self) -> TokenIndex {
        let mut names: Vec<(&str, usize)> = self.by_name.iter().map(|(name, row)| (name.as_str(), *row)).collect();
        names.sort_unstable_by_key(|(name, row)| (*row, *name));
        TokenIndex::new(names.into_iter())
    }

    /// Adds `tables` to the library, replacing materials, families and fillings of the same name.
    fn add(&mut self, tables: Tables) -> Result<(), LibraryError> {
        reject_duplicates(&tables.families, |family| vec![&family.name])?;
        reject_duplicates(&tables.fillings, |filling| vec![&filling.name])?;
        reject_duplicates(&tables.materials, |one| [&one.name].into_iter().chain(&one.aliases).collect())?;
        self.pass_on(&tables);
        let known = rows_by_name(self.families.iter().map(|family| &family.name));
        for Placed { row: family, .. } in tables.families {
            match known.get(&fold(&family.name)) {
                Some(&row) => {
                    let name = std::mem::take(&mut self.families[row].name);
                    self.families[row] = Family { name, ..family };
                }
                None => self.families.push(family),
            }
        }
        let known = rows_by_name(self.fillings.iter().map(|filling| &filling.name));
        for Placed { row: filling, .. } in tables.fillings {
            match known.get(&fold(&filling.name)) {
                Some(&row) => self.fillings[row] = filling,
                None => self.fillings.push(filling),
            }
        }
        extend(&mut self.references, tables.references, |reference| reference.id.clone())?;
        extend(&mut self.evidence, tables.evidence, |entry| format!("{}:{}", entry.source, entry.entry))?;
        extend(&mut self.rules, tables.rules, |rule| rule.id.clone())?;
        self.reference.extend(tables.reference);
        self.constituents.extend(tables.constituents);
        self.deviations.extend(tables.deviations);
        let families = rows_by_name(self.families.iter().map(|family| &family.name));
        let known = rows_by_name(self.materials.iter().map(|material| &material.name));
        let mut added = Vec::with_capacity(tables.materials.len());
        for placed in tables.materials {
            let family = self.family_of(&placed, &families)?;
            let material = Material { family: family.name.clone(), restitution: family.restitution, ..placed.row };
            match known.get(&fold(&material.name)) {
                Some(&row) => {
                    self.materials[row] = material;
                    added.push(row);
                }
                None => {
                    added.push(self.materials.len());
                    self.materials.push(material);
                }
            }
        }
        self.spell_as_materials();
        self.by_name.clear();
        self.index_names(&added);
        Ok(())
    }

    /// Marks the library's deviations as inherited, and drops the constituents that `tables` list anew.
    fn pass_on(&mut self, tables: &Tables) {
        self.deviations.iter_mut().for_each(|deviation| deviation.is_inherited = true);
        let listed: HashSet<String> = tables.constituents.iter().map(|one| fold(&one.material)).collect();
        self.constituents.retain(|one| !listed.contains(&fold(&one.material)));
    }

    /// Lets deviations and constituents name materials as these spell themselves: those of a material that was replaced
    /// apply to the new row, and a user's tables may spell a name in several ways.
    fn spell_as_materials(&mut self) {
        let names: HashMap<String, &String> =
            self.materials.iter().map(|material| (fold(&material.name), &material.name)).collect();
        let subjects = self.deviations.iter_mut().map(|deviation| &mut deviation.subject);
        for name in subjects.chain(self.constituents.iter_mut().map(|constituent| &mut constituent.material)) {
            if let Some(spelt) = names.get(&fold(name)) {
                name.clone_from(spelt);
            }
        }
    }

    /// A material's family; `families` are the rows by folded name.
    fn family_of(&self, placed: &Placed<Material>, families: &HashMap<String, usize>) -> Result<&Family, LibraryError> {
        let family = &placed.row.family;
        if let Some(&row) = families.get(&fold(family)) {
            return Ok(&self.families[row]);
        }
        let known: Vec<&str> = self.families.iter().map(|known| known.name.as_str()).collect();
        Err(placed.bad_key(family, format!("is not a family; write one of {}", known.join(", "))))
    }

    /// Adds names to the index, none of which takes the place of another: those of the `added` rows before all others, then
    /// names before aliases before inverted names.
    fn index_names(&mut self, added: &[usize]) {
        let materials = &self.materials;
        let by_name = &mut self.by_name;
        let mut insert = |name: &str, row: usize| {
            by_name.entry(fold(name)).or_insert(row);
        };
        for &row in added {
            insert(&materials[row].name, row);
            materials[row].aliases.iter().for_each(|alias| insert(alias, row));
        }
        for (row, material) in materials.iter().enumerate() {
            insert(&material.name, row);
        }
        for (row, material) in materials.iter().enumerate() {
            material.aliases.iter().for_each(|alias| insert(alias, row));
        }
        for (row, material) in materials.iter().enumerate() {
            material.aliases.iter().chain([&material.name]).filter_map(|name| inverted(name)).for_each(|name| {
                insert(&name, row);
            });
        }
        self.tokens = OnceLock::new();
    }
}

/// The file itself, or the folder's CSV files in the order of their names.
fn csv_files(path: &Path) -> Result<Vec<PathBuf>, LibraryError> {
    let unreadable = |source| LibraryError::Unreadable { path: path.to_owned(), source };
    if !fs::metadata(path).map_err(unreadable)?.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let mut files = Vec::new();
    for entry in fs::read_dir(path).map_err(unreadable)? {
        let file = entry.map_err(unreadable)?.path();
        if file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
            files.push(file);
        }
    }
    files.sort();
    if files.is_empty() { Err(LibraryError::Empty { path: path.to_owned() }) } else { Ok(files) }
}

/// The rows by their folded names.
fn rows_by_name<'a>(names: impl Iterator<Item = &'a String>) -> HashMap<String, usize> {
    names.enumerate().map(|(row, name)| (fold(name), row)).collect()
}

/// Adds rows of a table whose rows are never replaced. Two of the same name in citations have to be equal (a user's tables
/// may be a copy of the built-in ones), and count once.
fn extend<T: PartialEq>(
    rows: &mut Vec<T>,
    added: Vec<Placed<T>>,
    cited_as: impl Fn(&T) -> String,
) -> Result<(), LibraryError> {
    let mut known: HashMap<String, usize> =
        rows.iter().map(&cited_as).enumerate().map(|(at, name)| (name, at)).collect();
    for placed in added {
        let name = cited_as(&placed.row);
        match known.get(&name) {
            Some(&at) if rows[at] == placed.row => {}
            Some(_) => {
                let problem =
                    "already stands for another row, and rows of this table cannot be replaced; write another name";
                return Err(placed.bad_key(&name, problem.to_owned()));
            }
            None => {
                known.insert(name, rows.len());
                rows.push(placed.row);
            }
        }
    }
    Ok(())
}

/// A name or alias may stand for only one row in a set of tables. The first of the names of a row is its own.
fn reject_duplicates<T>(rows: &[Placed<T>], names: impl Fn(&T) -> Vec<&String>) -> Result<(), LibraryError> {
    let mut owners: HashMap<String, &str> = HashMap::new();
    for placed in rows {
        let names = names(&placed.row);
        let owner = names[0].as_str();
        for (at, name) in names.into_iter().enumerate() {
            match owners.insert(fold(name), owner) {
                Some(other) if at == 0 || other != owner => {
                    return Err(LibraryError::Duplicate {
                        file: placed.file.clone(),
                        line: placed.line,
                        name: name.clone(),
                        other: other.to_owned(),
                    });
                }
                _ => {}
            }
        }
    }
    Ok(())
}
