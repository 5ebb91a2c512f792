//! Smooth level sets of a binary volume: the peer's constrained smoothing of the density before it searches for the
//! inside (Lempitsky, *Surface Extraction from Binary Volumes with Higher-Order Smoothness*, 2010).
//!
//! In a band around the surface, projected Jacobi iterations change the signed distance so that its second differences
//! become small, while each cell stays on its side.

/// Half width of the band, cells.
const BAND: f64 = 4.0;
const ITERATIONS: usize = 500;
/// Steps between two checks of the energy, and the smallest relative decrease per step.
const CHECK_EACH: usize = 10;
const LEAST_FALL: f64 = 1e-6;
/// Share of a Jacobi step that is taken.
const WEIGHT: f64 = 0.5;
/// No neighbour in the band.
const NONE: u32 = u32::MAX;

/// The smoothed signed distance, positive where `inside`, of a cube of `cells` cells each way, last axis fastest.
pub fn smooth(inside: &[bool], cells: usize) -> Vec<f64> {
    let mut distance: Vec<f64> = {
        let (to_outside, to_inside) = (distances(inside, cells, false), distances(inside, cells, true));
        let signed = |i: usize| if inside[i] { to_outside[i] - 0.5 } else { 0.5 - to_inside[i] };
        (0..inside.len()).map(signed).collect()
    };
    let band: Vec<u32> = (0..inside.len() as u32).filter(|&i| distance[i as usize].abs() <= BAND).collect();
    let x = Energy::new(&band, cells).minimized(band.iter().map(|&i| distance[i as usize]).collect());
    for (&i, x) in band.iter().zip(x) {
        distance[i as usize] = x;
    }
    distance
}

/// Euclidean distance from every cell to the nearest one that is `target`; infinite if there is none (Felzenszwalb and
/// Huttenlocher, *Distance Transforms of Sampled Functions*, 2012).
fn distances(inside: &[bool], cells: usize, target: bool) -> Vec<f64> {
    let mut squared: Vec<f64> = inside.iter().map(|&i| if i == target { 0.0 } else { f64::INFINITY }).collect();
    for stride in [1, cells, cells * cells] {
        for line in 0..cells * cells {
            let start = line / stride * stride * cells + line % stride;
            let values: Vec<f64> = (0..cells).map(|i| squared[start + i * stride]).collect();
            for (i, value) in lower_envelope(&values).into_iter().enumerate() {
                squared[start + i * stride] = value;
            }
        }
    }
    squared.into_iter().map(f64::sqrt).collect()
}

/// min over j of `values[j] + (i - j)^2`, for every i.
fn lower_envelope(values: &[f64]) -> Vec<f64> {
    // Parabolas of the envelope, and where each starts.
    let mut parabolas: Vec<(usize, f64)> = Vec::new();
    for (j, value) in values.iter().enumerate().filter(|(_, v)| v.is_finite()) {
        let meets = |&(k, _): &(usize, f64)| {
            ((value + (j * j) as f64) - (values[k] + (k * k) as f64)) / (2.0 * (j as f64 - k as f64))
        };
        while parabolas.last().is_some_and(|last| meets(last) <= last.1) {
            parabolas.pop();
        }
        let begins = parabolas.last().map_or(f64::NEG_INFINITY, meets);
        parabolas.push((j, begins));
    }
    let mut at = 0;
    (0..values.len())
        .map(|i| {
            while at + 1 < parabolas.len() && parabolas[at + 1].1 < i as f64 {
                at += 1;
            }
            parabolas.get(at).map_or(f64::INFINITY, |&(j, _)| values[j] + (i as f64 - j as f64).powi(2))
        })
        .collect()
}

/// Sum of the squared second differences along each axis over the band; if a neighbour lies outside it, the cell's own
/// value is used for it.
struct Energy {
    /// Per cell of the band and axis: the neighbours before and after.
    neighbours: Vec<[[u32; 2]; 3]>,
    /// Diagonal of the quadratic form.
    diagonal: Vec<f64>,
}

impl Energy {
    fn new(band: &[u32], cells: usize) -> Self {
        let mut number = vec![NONE; cells * cells * cells];
        for (n, &i) in band.iter().enumerate() {
            number[i as usize] = n as u32;
        }
        let neighbours_of = |i: usize| {
            [cells * cells, cells, 1].map(|stride| {
                let along = i / stride % cells;
                let before = if along > 0 { number[i - stride] } else { NONE };
                let after = if along + 1 < cells { number[i + stride] } else { NONE };
                [before, after]
            })
        };
        let neighbours: Vec<[[u32; 2]; 3]> = band.iter().map(|&i| neighbours_of(i as usize)).collect();
        let diagonal =
            neighbours.iter().map(|n| n.iter().map(|pair| own_factor(pair).powi(2) - own_factor(pair)).sum()).collect();
        Self { neighbours, diagonal }
    }

    /// The product of the quadratic form's matrix and `x`.
    fn times(&self, x: &[f64]) -> Vec<f64> {
        let value_at = |values: &[f64], n: u32| if n == NONE { 0.0 } else { values[n as usize] };
        let mut result = vec![0.0; x.len()];
        for axis in 0..3 {
            let pairs = || self.neighbours.iter().map(move |n| &n[axis]);
            let second: Vec<f64> = pairs()
                .zip(x)
                .map(|(pair, x_own)| own_factor(pair) * x_own + value_at(x, pair[0]) + value_at(x, pair[1]))
                .collect();
            for ((result, pair), s) in result.iter_mut().zip(pairs()).zip(&second) {
                *result += own_factor(pair) * s + value_at(&second, pair[0]) + value_at(&second, pair[1]);
            }
        }
        result
    }

    fn minimized(&self, mut x: Vec<f64>) -> Vec<f64> {
        // Cells at the surface may come as close to it as they like; all others keep at least their distance.
        let bound = |d: f64| if d.abs() < 1.0 { 0.0 } else { d };
        let bounds: Vec<[f64; 2]> = x
            .iter()
            .map(|&d| if d > 0.0 { [bound(d), f64::INFINITY] } else { [f64::NEG_INFINITY, bound(d)] })
            .collect();
        let least_fall = 1.0 - (1.0 - LEAST_FALL).powi(CHECK_EACH as i32);
        let mut product = self.times(&x);
        let energy = |x: &[f64], product: &[f64]| x.iter().zip(product).map(|(a, b)| a * b).sum::<f64>() / 2.0;
        let mut before = energy(&x, &product);
        for iteration in 1..=ITERATIONS {
            for (i, x) in x.iter_mut().enumerate() {
                *x = (*x - WEIGHT * product[i] / self.diagonal[i]).max(bounds[i][0]).min(bounds[i][1]);
            }
            product = self.times(&x);
            if iteration % CHECK_EACH == 0 {
                let now = energy(&x, &product);
                if (before - now) / before < least_fall {
                    break;
                }
                before = now;
            }
        }
        x
    }
}

/// Factor of the cell itself in its second difference: -2, plus 1 for each neighbour outside the band.
fn own_factor(pair: &[u32; 2]) -> f64 {
    pair.iter().filter(|n| **n == NONE).count() as f64 - 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_a_search() {
        let cells = 7;
        let inside: Vec<bool> = (0..cells * cells * cells).map(|i| i * 7919 % 31 == 0).collect();
        let place = |i: usize| [i / cells / cells, i / cells % cells, i % cells].map(|x| x as f64);
        let found = distances(&inside, cells, true);
        for (i, found) in found.into_iter().enumerate() {
            let apart = |j: usize| (0..3).map(|a| (place(i)[a] - place(j)[a]).powi(2)).sum::<f64>().sqrt();
            let nearest = (0..inside.len()).filter(|&j| inside[j]).map(apart).fold(f64::INFINITY, f64::min);
            assert!((found - nearest).abs() < 1e-12, "cell {i}: {found} not {nearest}");
        }
    }

    /// Results of PyMCubes 0.1.6, the peer's library, for a staircase and for a cube: the output of
    /// `mcubes.smooth(inside, 'constrained')` and its energy over the band.
    #[test]
    fn smooths_as_the_peers_library() {
        let cells = 16;
        let place = |i: usize| [i / cells / cells, i / cells % cells, i % cells];
        let volume = |holds: &dyn Fn([usize; 3]) -> bool| -> Vec<bool> {
            (0..cells * cells * cells).map(|i| holds(place(i))).collect()
        };
        let stairs = volume(&|[x, y, _]| x + y < 13);
        let smoothed = smooth(&stairs, cells);
        let band: Vec<u32> = (0..stairs.len() as u32).filter(|&i| smoothed[i as usize].abs() <= BAND).collect();
        let x: Vec<f64> = band.iter().map(|&i| smoothed[i as usize]).collect();
        let energy: f64 = x.iter().zip(Energy::new(&band, cells).times(&x)).map(|(a, b)| a * b).sum();
        assert_eq!(band.len(), 2400);
        assert!((energy - 235.738_741_891_244).abs() < 1e-9, "{energy}");

        let smoothed = smooth(&volume(&|p| p.iter().all(|i| (5..12).contains(i))), cells);
        let middle = [-4.5, -3.5, -2.72688153, -1.5, -0.05582085, 1.32062396, 2.4362733, 3.17702791];
        for (z, expected) in middle.into_iter().enumerate() {
            let found = smoothed[(8 * cells + 8) * cells + z];
            assert!((found - expected).abs() < 1e-8, "z {z}: {found} not {expected}");
        }
    }
}
