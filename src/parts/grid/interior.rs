//! The object's inside, cell by cell, in memory and as bytes.
//!
//! Layout of the bytes, little endian: magic, version (u32), the grid's origin (3 f64), side of a cell (f64), cells
//! along each axis (3 u64), number of runs (u64), then the runs: part (u32), share that is material (f32), cells (u32).
//! Runs are in the order of the cells and as long as possible. Neighbouring cells mostly hold the same values, so this
//! takes a tenth of the space that two numbers per cell would.

use std::io::{self, Write};

use nalgebra::Point3;

use super::Grid;
use crate::parts::PartsError;

/// A cell outside the object.
pub const OUTSIDE: u32 = u32::MAX;
/// An empty cell enclosed by a shell.
pub const VOID: u32 = u32::MAX - 1;

/// A cell filled by something inside of a shell has this number plus the shell's id.
pub const FILLING: u32 = 1 << 31;

const MAGIC: &[u8; 8] = b"gpropins";
/// Bytes per run.
const RUN: usize = 12;

/// The part that fills each cell of space, including the object's inside.
#[derive(Debug, Clone, PartialEq)]
pub struct Interior {
    pub grid: Grid,
    /// Per cell: index of the label of the part that fills it, [`FILLING`] plus that of the shell whose filling does, [`OUTSIDE`] or
    /// [`VOID`].
    pub part: Vec<u32>,
    /// Per cell: share of it that is material, 0 to 1. Below 1 where a wall is thinner than the cell.
    pub fraction: Vec<f32>,
}

impl Interior {
    /// Incremented when the layout of the bytes or their meaning changes.
    pub const VERSION: u32 = 2;

    /// Cells that hold material of a part, not a filling: index, part, share.
    pub fn filled(&self) -> impl Iterator<Item = (usize, u32, f64)> + '_ {
        let cells = self.part.iter().zip(&self.fraction).enumerate();
        cells.filter(|(_, (part, _))| **part < FILLING).map(|(i, (part, share))| (i, *part, f64::from(*share)))
    }

    /// Cells that hold a filling: index, the shell that it is in, share.
    pub fn fillings(&self) -> impl Iterator<Item = (usize, u32, f64)> + '_ {
        let cells = self.part.iter().zip(&self.fraction).enumerate();
        cells
            .filter(|(_, (part, _))| (FILLING..VOID).contains(*part))
            .map(|(i, (part, share))| (i, *part - FILLING, f64::from(*share)))
    }

    /// Writes the bytes that [`from_bytes`](Self::from_bytes) reads.
    ///
    /// # Errors
    /// Any error of the writer.
    pub fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let runs: Vec<(u32, f32, u32)> = self.runs().collect();
        out.write_all(MAGIC)?;
        out.write_all(&Self::VERSION.to_le_bytes())?;
        self.grid.origin.iter().chain([&self.grid.cell]).try_for_each(|number| out.write_all(&number.to_le_bytes()))?;
        self.grid.dims.iter().try_for_each(|&cells| out.write_all(&(cells as u64).to_le_bytes()))?;
        out.write_all(&(runs.len() as u64).to_le_bytes())?;
        runs.iter().try_for_each(|(part, share, cells)| {
            out.write_all(&part.to_le_bytes())?;
            out.write_all(&share.to_le_bytes())?;
            out.write_all(&cells.to_le_bytes())
        })
    }

    /// Runs of consecutive cells with the same contents: part, share, number of cells.
    fn runs(&self) -> impl Iterator<Item = (u32, f32, u32)> + '_ {
        let mut rest = 0;
        std::iter::from_fn(move || {
            let (part, share) = (*self.part.get(rest)?, self.fraction[rest]);
            let same = |i: &usize| self.part[*i] == part && self.fraction[*i].to_bits() == share.to_bits();
            let end = self.part.len().min(rest + u32::MAX as usize);
            let cells = (rest..end).take_while(same).count();
            rest += cells;
            Some((part, share, cells as u32))
        })
    }

    /// Reads what [`write`](Self::write) wrote for a grid of about `volume_cells` cells
    /// ([`Options::volume_cells`](crate::parts::Options::volume_cells)) filled with parts below `parts`.
    ///
    /// # Errors
    /// [`PartsError::Interior`] if the bytes are not those of a whole interior of this version, or if it has more cells
    /// or parts than that.
    pub fn from_bytes(bytes: &[u8], volume_cells: usize, parts: usize) -> Result<Self, PartsError> {
        let mut rest = bytes;
        if take::<8>(&mut rest)? != *MAGIC {
            return Err(damaged("it does not hold the inside of an object"));
        }
        let version = u32::from_le_bytes(take(&mut rest)?);
        if version != Self::VERSION {
            return Err(damaged(format!("its version is {version}, not {}", Self::VERSION)));
        }
        let grid = read_grid(&mut rest, volume_cells)?;
        let count = u64::from_le_bytes(take(&mut rest)?);
        if u64::try_from(rest.len()).ok() != count.checked_mul(RUN as u64) {
            return Err(damaged(format!("{count} runs do not fit its length")));
        }
        let mut interior = Self { part: Vec::new(), fraction: Vec::new(), grid };
        let total = grid.len();
        while !rest.is_empty() {
            let part = u32::from_le_bytes(take(&mut rest)?);
            let share = f32::from_le_bytes(take(&mut rest)?);
            let end = interior.part.len().saturating_add(u32::from_le_bytes(take(&mut rest)?) as usize);
            if end > total {
                return Err(damaged(format!("its runs have more than {total} cells")));
            }
            let owner = part & !FILLING;
            if part < VOID && owner as usize >= parts {
                return Err(damaged(format!("its cells name part {owner}, but there are only {parts} parts")));
            }
            if !(0.0..=1.0).contains(&share) {
                return Err(damaged(format!("the share of material in a cell is {share}")));
            }
            interior.part.resize(end, part);
            interior.fraction.resize(end, share);
        }
        if interior.part.len() < total {
            return Err(damaged(format!("its runs have {} cells, not {total}", interior.part.len())));
        }
        Ok(interior)
    }
}

fn read_grid(rest: &mut &[u8], volume_cells: usize) -> Result<Grid, PartsError> {
    let mut number = || Ok::<_, PartsError>(f64::from_le_bytes(take(rest)?));
    let origin = Point3::new(number()?, number()?, number()?);
    let cell = number()?;
    let mut dims = [0; 3];
    for cells in &mut dims {
        *cells = usize::try_from(u64::from_le_bytes(take(rest)?)).unwrap_or(usize::MAX);
    }
    let (all, most) =
        (dims.iter().try_fold(1, |all: usize, &cells| all.checked_mul(cells)), Grid::most_cells(volume_cells));
    if !all.is_some_and(|all| (1..=most).contains(&all)) {
        let [x, y, z] = dims;
        return Err(damaged(format!("a grid of about {volume_cells} cells cannot have {x} x {y} x {z} cells")));
    }
    let grid = Grid { origin, cell, dims };
    let is_finite =
        origin.iter().chain(grid.middle().iter()).chain([&grid.cell_volume()]).all(|number| number.is_finite());
    if !(is_finite && cell > 0.0) {
        let [x, y, z] = origin.into();
        return Err(damaged(format!("its cells have a side of {cell} and begin at {x}, {y}, {z}")));
    }
    Ok(grid)
}

fn take<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], PartsError> {
    let (head, tail) = rest.split_first_chunk().ok_or_else(|| damaged("it is cut off"))?;
    *rest = tail;
    Ok(*head)
}

fn damaged(problem: impl Into<String>) -> PartsError {
    PartsError::Interior(problem.into())
}
