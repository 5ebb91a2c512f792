//! Sets of items that are joined one pair after the other (union-find), with a direction of each item relative to its set.

/// Disjoint sets.
#[derive(Debug, Clone)]
pub struct Forest {
    /// Per item: another of its set, or itself if it is the root, and whether their directions differ.
    parent: Vec<(u32, bool)>,
}

impl Forest {
    /// Each item in a set of its own.
    pub fn of(count: usize) -> Self {
        Self { parent: (0..count as u32).map(|item| (item, false)).collect() }
    }

    /// The root of an item's set, and whether its direction differs from the root's.
    pub fn root(&self, item: usize) -> (usize, bool) {
        let (mut at, mut differs) = (item as u32, false);
        while self.parent[at as usize].0 != at {
            let (parent, turn) = self.parent[at as usize];
            (at, differs) = (parent, differs ^ turn);
        }
        (at as usize, differs)
    }

    /// Joins the sets of two items whose directions differ as said (`false` if directions do not matter). False if both are in one set already, with
    /// directions that contradict it.
    pub fn join(&mut self, a: usize, b: usize, differ: bool) -> bool {
        let (root_a, turn_a) = self.shortened(a);
        let (root_b, turn_b) = self.shortened(b);
        let turn = turn_a ^ turn_b ^ differ;
        if root_a != root_b {
            // The smallest item is the root.
            let (parent, child) = (root_a.min(root_b), root_a.max(root_b));
            self.parent[child] = (parent as u32, turn);
        }
        root_a != root_b || !turn
    }

    /// The root of an item; every other item on the way to it then points two steps on.
    fn shortened(&mut self, item: usize) -> (usize, bool) {
        let (mut at, mut differs) = (item, false);
        loop {
            let (parent, turn) = self.parent[at];
            if parent as usize == at {
                return (at, differs);
            }
            let (next, next_turn) = self.parent[parent as usize];
            self.parent[at] = (next, turn ^ next_turn);
            (at, differs) = (next as usize, differs ^ turn ^ next_turn);
        }
    }

    /// Numbers the sets in the order of their first items; per item, its set's number.
    pub fn numbered(&self) -> (Vec<u32>, usize) {
        let mut count = 0;
        let mut number = vec![0; self.parent.len()];
        for item in 0..self.parent.len() {
            // Roots are the smallest items of their sets, so they are numbered first.
            let root = self.root(item).0;
            number[item] = if root == item { count } else { number[root] };
            count += u32::from(root == item);
        }
        (number, count as usize)
    }
}
