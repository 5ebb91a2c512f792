//! Binary rows: chunks of them are read and decoded on all threads, each directly into its slice of the arrays.

use std::io;
use std::sync::{Mutex, PoisonError};

use super::header::Header;
use super::layout::{self, Array, Column, Layout, Scalar};
use super::source::Bytes;
use super::{Problem, Rows};
use crate::parallel;

/// Bytes read at once: a chunk stays in a core's second-level cache while its columns are extracted one by one.
const CHUNK_BYTES: usize = 256 << 10;

/// Minimum rows per chunk: keeps the overhead per chunk and column small relative to the values of any file.
const LEAST_ROWS: usize = 64;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ByteOrder {
    Little,
    Big,
}

pub(super) fn read(bytes: &impl Bytes, header: &Header, layout: &Layout, order: ByteOrder) -> Result<Rows, Problem> {
    let first_row_at = u128::from(header.data_at) + layout.before;
    let expected = first_row_at + u128::from(layout.count) * layout.stride as u128;
    if expected > u128::from(bytes.size()) {
        return Err(Problem::Truncated { count: layout.count, expected, found: bytes.size() });
    }
    // Both casts are lossless: the values are no larger than the file.
    let (first_row_at, left_over) = (first_row_at as u64, bytes.size() - expected as u64);

    let mut gaussians = layout.allocate(layout.count as usize);
    let rows_per_chunk = (CHUNK_BYTES / layout.stride).max(LEAST_ROWS);
    let buffers: Mutex<Vec<Vec<u8>>> = Mutex::default();
    let free = || buffers.lock().unwrap_or_else(PoisonError::into_inner);
    let read_chunk = |index: usize, chunk: &mut Vec<Array<'_>>| -> io::Result<bool> {
        let row = index * rows_per_chunk;
        let rows = rows_per_chunk.min(layout.count as usize - row);
        let mut buffer = free().pop().unwrap_or_default();
        buffer.resize(rows * layout.stride, 0);
        bytes.read_at(first_row_at + (row * layout.stride) as u64, &mut buffer)?;
        decode(&buffer, layout, order, chunk);
        free().push(buffer);
        Ok(layout::surely_usable(chunk))
    };
    let mut surely_usable = true;
    for is_usable in parallel::map_mut(&mut chunks(layout::arrays(&mut gaussians), rows_per_chunk), read_chunk) {
        surely_usable &= is_usable?;
    }

    let warning = (left_over > 0 && !layout.followed)
        .then(|| format!("{left_over} bytes after the last Gaussian are not declared in the header; they are ignored"));
    Ok(Rows { gaussians, surely_usable, warning })
}

/// Splits all arrays into slices of `rows` Gaussians.
fn chunks(arrays: Vec<Array<'_>>, rows: usize) -> Vec<Vec<Array<'_>>> {
    let mut chunks = Vec::new();
    for (index, Array { values, width }) in arrays.into_iter().enumerate() {
        // An array of width zero (SH degree 0) has no values, but each chunk needs its place.
        let mut shares = values.chunks_mut((rows * width).max(1));
        if index == 0 {
            chunks = shares.map(|values| vec![Array { values, width }]).collect();
        } else {
            for chunk in &mut chunks {
                chunk.push(Array { values: shares.next().unwrap_or_default(), width });
            }
        }
    }
    chunks
}

fn decode(rows: &[u8], layout: &Layout, order: ByteOrder, chunk: &mut [Array<'_>]) {
    use ByteOrder::{Big, Little};
    for column in &layout.columns {
        let array = &mut chunk[column.array];
        let stride = layout.stride;
        match (column.scalar, order) {
            (Scalar::F32, Little) => copy(rows, stride, column, array, f32::from_le_bytes),
            (Scalar::F32, Big) => copy(rows, stride, column, array, f32::from_be_bytes),
            (Scalar::F64, Little) => copy(rows, stride, column, array, |b| f64::from_le_bytes(b) as f32),
            (Scalar::F64, Big) => copy(rows, stride, column, array, |b| f64::from_be_bytes(b) as f32),
            (Scalar::I8, _) => copy(rows, stride, column, array, |b| i8::from_le_bytes(b).into()),
            (Scalar::U8, _) => copy(rows, stride, column, array, |[b]| b.into()),
            (Scalar::I16, Little) => copy(rows, stride, column, array, |b| i16::from_le_bytes(b).into()),
            (Scalar::I16, Big) => copy(rows, stride, column, array, |b| i16::from_be_bytes(b).into()),
            (Scalar::U16, Little) => copy(rows, stride, column, array, |b| u16::from_le_bytes(b).into()),
            (Scalar::U16, Big) => copy(rows, stride, column, array, |b| u16::from_be_bytes(b).into()),
            (Scalar::I32, Little) => copy(rows, stride, column, array, |b| i32::from_le_bytes(b) as f32),
            (Scalar::I32, Big) => copy(rows, stride, column, array, |b| i32::from_be_bytes(b) as f32),
            (Scalar::U32, Little) => copy(rows, stride, column, array, |b| u32::from_le_bytes(b) as f32),
            (Scalar::U32, Big) => copy(rows, stride, column, array, |b| u32::from_be_bytes(b) as f32),
        }
    }
}

/// Copies one column of `N`-byte values out of all rows.
fn copy<const N: usize>(
    rows: &[u8],
    stride: usize,
    column: &Column,
    array: &mut Array<'_>,
    value_of: impl Fn([u8; N]) -> f32,
) {
    let (from, to) = (column.offset, column.lane);
    for (row, values) in rows.chunks_exact(stride).zip(array.values.chunks_exact_mut(array.width)) {
        let (encoded, _) = row[from..from + column.length * N].as_chunks::<N>();
        for (value, encoded) in values[to..to + column.length].iter_mut().zip(encoded) {
            *value = value_of(*encoded);
        }
    }
}
