//! Products of small matrices whose right factor stays in the cache.

use crate::simd::Vector;

/// A left factor: value (i, j) is `values[i * row + j * column]`.
#[derive(Clone, Copy)]
pub struct Left<'a> {
    pub values: &'a [f32],
    pub row: usize,
    pub column: usize,
}

/// A right factor, whose rows are `row` values apart.
#[derive(Clone, Copy)]
pub struct Right<'a> {
    pub values: &'a [f32],
    pub row: usize,
}

/// The memory for the product, with rows `row` values apart.
pub struct Product<'a> {
    pub values: &'a mut [f32],
    pub row: usize,
}

/// The values that the product is added to.
#[derive(Clone, Copy)]
pub enum Start<'a> {
    Zero,
    /// This row, added to every row.
    Row(&'a [f32]),
    /// The values already in the product's memory.
    There,
}

/// `product = start + left right` for `rows` x `inner` and `inner` x `columns` values. `columns` is a multiple of the
/// vector's width.
#[inline(always)]
pub fn multiply<V: Vector>(
    left: Left<'_>,
    right: Right<'_>,
    start: Start<'_>,
    product: Product<'_>,
    [rows, inner, columns]: [usize; 3],
) {
    assert!(columns.is_multiple_of(V::WIDTH) && rows > 0 && inner > 0 && columns > 0);
    // A sum that is too large for usize is too large for any slice too.
    let last = |count: usize, stride: usize| (count - 1).saturating_mul(stride);
    assert!(left.values.len() > last(rows, left.row).saturating_add(last(inner, left.column)));
    assert!(right.values.len() >= last(inner, right.row).saturating_add(columns));
    assert!(product.values.len() >= last(rows, product.row).saturating_add(columns));
    if let Start::Row(row) = start {
        assert!(row.len() >= columns);
    }
    let mut column = 0;
    while column < columns {
        // Computing many sums at once, over many rows or many columns, hides the latency of each.
        let vectors_left = (columns - column) / V::WIDTH;
        let vectors = match (rows, vectors_left) {
            (..4, 8..) => 8,
            (_, 2..) => 2,
            _ => 1,
        };
        let start = match start {
            Start::Row(values) => Start::Row(&values[column..]),
            other => other,
        };
        let mut row = 0;
        while row < rows {
            let tile = Tile {
                // SAFETY: `row < rows`, and `left` reaches beyond `(rows - 1) * left.row`, as asserted above.
                left: unsafe { left.values.as_ptr().add(row * left.row) },
                left_row: left.row,
                left_column: left.column,
                // SAFETY: `column < columns`, and `right` has `columns` values at least, as asserted above.
                right: unsafe { right.values.as_ptr().add(column) },
                right_row: right.row,
                // SAFETY: `row < rows`, `column < columns`, and `product` has `(rows - 1) * product.row + columns`
                // values at least, as asserted above.
                product: unsafe { product.values.as_mut_ptr().add(row * product.row + column) },
                product_row: product.row,
                inner,
            };
            // SAFETY: the tile has no more rows than are left (`rows - row` in the patterns), and no more columns:
            // `vectors` is at most `vectors_left`, so `column + vectors * WIDTH <= columns`. With the asserts above,
            // row `rows - 1` of `left` ends with value `inner - 1`, row `inner - 1` of `right` and row `rows - 1` of
            // `product` with value `columns - 1`, all inside their slices; `Start::Row` has `columns - column` values
            // left.
            row += unsafe {
                // AVX-512 has twice the registers.
                match (V::WIDTH, rows - row, vectors) {
                    (16, 8.., 2) => tile.run::<V, 8, 2>(start),
                    (16, 8.., 1) => tile.run::<V, 8, 1>(start),
                    (_, 4.., 2) => tile.run::<V, 4, 2>(start),
                    (_, 4.., 1) => tile.run::<V, 4, 1>(start),
                    (.., 8) => tile.run::<V, 1, 8>(start),
                    (.., 2) => tile.run::<V, 1, 2>(start),
                    _ => tile.run::<V, 1, 1>(start),
                }
            };
        }
        column += vectors * V::WIDTH;
    }
}

/// The memory for a tile of the product, whose sums stay in registers.
struct Tile {
    left: *const f32,
    left_row: usize,
    left_column: usize,
    right: *const f32,
    right_row: usize,
    product: *mut f32,
    product_row: usize,
    inner: usize,
}

impl Tile {
    /// Computes `ROWS` rows of `VECTORS` vectors; returns `ROWS`.
    ///
    /// # Safety
    /// From [`Self::left`] on, `ROWS` rows of [`Self::inner`] values can be read with the given strides; from
    /// [`Self::right`] on, [`Self::inner`] rows of `VECTORS * V::WIDTH` values; from [`Self::product`] on, `ROWS` rows
    /// of as many can be read and written; and [`Start::Row`] holds as many.
    #[inline(always)]
    unsafe fn run<V: Vector, const ROWS: usize, const VECTORS: usize>(&self, start: Start<'_>) -> usize {
        let mut sums = [[V::splat(0.0); VECTORS]; ROWS];
        for (row, sums) in sums.iter_mut().enumerate() {
            for (vector, sum) in sums.iter_mut().enumerate() {
                let offset = vector * V::WIDTH;
                *sum = match start {
                    Start::Zero => V::splat(0.0),
                    // SAFETY: `offset + WIDTH <= VECTORS * WIDTH`, which the caller says `values` holds.
                    Start::Row(values) => unsafe { V::read(values.as_ptr().add(offset)) },
                    // SAFETY: `row < ROWS` and `offset + WIDTH <= VECTORS * WIDTH`, which the caller says can be read.
                    Start::There => unsafe { V::read(self.product.add(row * self.product_row + offset)) },
                };
            }
        }
        for k in 0..self.inner {
            let mut right = [V::splat(0.0); VECTORS];
            for (vector, right) in right.iter_mut().enumerate() {
                // SAFETY: `k < inner` and the vector ends within `VECTORS * WIDTH`, which the caller says can be read.
                *right = unsafe { V::read(self.right.add(k * self.right_row + vector * V::WIDTH)) };
            }
            for (row, sums) in sums.iter_mut().enumerate() {
                // SAFETY: `row < ROWS` and `k < inner`, which the caller says can be read.
                let left = V::splat(unsafe { *self.left.add(row * self.left_row + k * self.left_column) });
                for (sum, right) in sums.iter_mut().zip(right) {
                    *sum = left.mul_add(right, *sum);
                }
            }
        }
        for (row, sums) in sums.iter().enumerate() {
            for (vector, sum) in sums.iter().enumerate() {
                // SAFETY: `row < ROWS` and the vector ends within `VECTORS * WIDTH`, which the caller says can be
                // written.
                unsafe { sum.write(self.product.add(row * self.product_row + vector * V::WIDTH)) };
            }
        }
        ROWS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::Plain;

    #[test]
    fn products_of_any_strides_are_those_of_the_definition() {
        let [rows, inner, columns] = [13, 5, 24];
        let left: Vec<f32> = (0..rows * inner).map(|i| (i % 7) as f32 - 3.0).collect();
        let right: Vec<f32> = (0..inner * columns).map(|i| (i % 5) as f32).collect();
        let row: Vec<f32> = (0..columns).map(|i| i as f32).collect();
        for (left_row, left_column) in [(inner, 1), (1, rows)] {
            let mut product = vec![1.0; rows * columns];
            for start in [Start::Row(&row), Start::There] {
                multiply::<Plain>(
                    Left { values: &left, row: left_row, column: left_column },
                    Right { values: &right, row: columns },
                    start,
                    Product { values: &mut product, row: columns },
                    [rows, inner, columns],
                );
            }
            for i in 0..rows {
                for j in 0..columns {
                    let term = |k: usize| left[i * left_row + k * left_column] * right[k * columns + j];
                    let expected = row[j] + 2.0 * (0..inner).map(term).sum::<f32>();
                    assert_eq!(product[i * columns + j], expected, "({i}, {j})");
                }
            }
        }
    }
}
