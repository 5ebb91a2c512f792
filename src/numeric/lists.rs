//! Lists of numbers, one behind the other in memory: what lies in each cell, or around each vertex.

/// As many lists as there are keys.
#[derive(Debug, Clone)]
pub struct Lists {
    /// Where each list begins in `entries`, and where the last one ends.
    starts: Vec<usize>,
    entries: Vec<u32>,
}

impl Lists {
    /// `each` visits every entry with the number of its list, below `count`; entries keep that order. It is called twice, and
    /// must visit the same.
    pub fn new(count: usize, each: impl Fn(&mut dyn FnMut(usize, u32))) -> Self {
        let mut starts = vec![0; count + 1];
        each(&mut |list, _| starts[list + 1] += 1);
        for list in 0..count {
            starts[list + 1] += starts[list];
        }
        let mut next = starts.clone();
        let mut entries = vec![0; starts[count]];
        each(&mut |list, entry| {
            entries[next[list]] = entry;
            next[list] += 1;
        });
        Self { starts, entries }
    }

    /// The entries of a list.
    pub fn of(&self, list: usize) -> &[u32] {
        &self.entries[self.starts[list]..self.starts[list + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_keep_the_order_of_their_entries() {
        let visited = [(2, 7), (0, 5), (2, 3), (0, 9)];
        let lists = Lists::new(4, |visit| visited.iter().for_each(|(list, entry)| visit(*list, *entry)));
        assert_eq!([0, 1, 2, 3].map(|list| lists.of(list).to_vec()), [vec![5, 9], vec![], vec![7, 3], vec![]]);
    }
}
