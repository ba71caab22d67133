//! The order of the states in which A is as triangular as a permutation makes it.

use nalgebra::DMatrix;
use std::ops::Range;

/// The states, and what they fall into.
pub(crate) struct Order {
    /// Downstream states precede the states that drive them: the reverse topological order of strongly connected components.
    pub(crate) states: Vec<usize>,
    /// States that reach each other both ways.
    pub(crate) blocks: Vec<Range<usize>>,
    /// Blocks that have to do with each other, whichever way and by whatever detour.
    pub(crate) parts: Vec<Range<usize>>,
}

impl Order {
    pub(crate) fn new(a: &DMatrix<f64>) -> Self {
        let n = a.nrows();
        let mut groups = components(a);
        let part = parts(a);
        groups.sort_by_key(|group| part[group[0]]);
        let mut order = Self {
            states: Vec::with_capacity(n),
            blocks: Vec::with_capacity(groups.len()),
            parts: Vec::new(),
        };
        let mut last = None;
        for group in groups {
            let range = order.states.len()..order.states.len() + group.len();
            let own = Some(part[group[0]]);
            match order.parts.last_mut() {
                Some(same) if own == last => same.end = range.end,
                _ => order.parts.push(range.clone()),
            }
            last = own;
            order.states.extend(group);
            order.blocks.push(range);
        }
        order
    }
}

/// States that reach each other both ways; whoever is fed comes before those who feed it.
pub(super) fn components(a: &DMatrix<f64>) -> Vec<Vec<usize>> {
    let n = a.nrows();
    let mut search = Search {
        a,
        found: vec![0; n],
        low: vec![0; n],
        open: Vec::new(),
        is_open: vec![false; n],
        count: 0,
        blocks: Vec::new(),
    };
    for i in 0..n {
        if search.found[i] == 0 {
            search.visit(i);
        }
    }
    // Those who feed are found first.
    search.blocks.reverse();
    search.blocks
}

/// For each state the first state of its part.
fn parts(a: &DMatrix<f64>) -> Vec<usize> {
    let n = a.nrows();
    let mut part = vec![n; n];
    for first in 0..n {
        let mut next = vec![first];
        while let Some(i) = next.pop() {
            if part[i] < n {
                continue;
            }
            part[i] = first;
            next.extend((0..n).filter(|&j| part[j] == n && (a[(i, j)] != 0.0 || a[(j, i)] != 0.0)));
        }
    }
    part
}

/// The search for strongly connected components along the entries of A, from a state to those that feed it \[tarjan1972\].
struct Search<'a> {
    a: &'a DMatrix<f64>,
    /// The how-manieth a state was to be found, from 1; 0 if it was not yet.
    found: Vec<usize>,
    /// The first found of those that it reaches.
    low: Vec<usize>,
    /// Those whose component is not closed.
    open: Vec<usize>,
    is_open: Vec<bool>,
    count: usize,
    blocks: Vec<Vec<usize>>,
}

impl Search<'_> {
    fn visit(&mut self, i: usize) {
        self.count += 1;
        (self.found[i], self.low[i]) = (self.count, self.count);
        self.open.push(i);
        self.is_open[i] = true;
        for j in 0..self.a.nrows() {
            if self.a[(i, j)] == 0.0 {
                continue;
            }
            if self.found[j] == 0 {
                self.visit(j);
                self.low[i] = self.low[i].min(self.low[j]);
            } else if self.is_open[j] {
                self.low[i] = self.low[i].min(self.found[j]);
            }
        }
        if self.low[i] == self.found[i] {
            let at = self.open.iter().position(|j| *j == i).unwrap_or_default();
            let mut block = self.open.split_off(at);
            block.iter().for_each(|&j| self.is_open[j] = false);
            block.sort_unstable();
            self.blocks.push(block);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Order;
    use nalgebra::DMatrix;

    /// A chain into a loop of two, beside a state alone and a loop of three that feeds the last state.
    #[test]
    fn what_is_fed_comes_first() {
        let mut a = DMatrix::zeros(8, 8);
        for (from, to) in [(0, 1), (1, 2), (2, 1), (4, 5), (5, 6), (6, 4), (6, 7)] {
            a[(to, from)] = 1.0;
        }
        let order = Order::new(&a);
        assert_eq!(order.states, [1, 2, 0, 3, 7, 4, 5, 6]);
        assert_eq!(order.blocks, [0..2, 2..3, 3..4, 4..5, 5..8]);
        assert_eq!(order.parts, [0..3, 3..4, 4..8]);
    }
}
