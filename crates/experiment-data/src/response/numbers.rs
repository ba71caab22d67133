//! Arrays of any shape, real or complex, as files hold them.

use crate::error::ResponseFault;
use lpv_core::num_complex::Complex;

/// What stands in a file: names, and the words of texts.
pub(crate) struct Entries {
    pub(crate) names: Vec<String>,
    pub(crate) texts: Vec<(String, String)>,
}

/// Numbers of any shape.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Numbers {
    /// As the file's own program counts it.
    pub(crate) shape: Vec<u64>,
    /// Whether the last index is the fastest, else the first.
    pub(crate) last_fastest: bool,
    pub(crate) re: Vec<f64>,
    /// None of real numbers.
    pub(crate) im: Option<Vec<f64>>,
}

impl Numbers {
    /// The entries in the order of `sizes`, its last index fastest. Indices that run over one entry may be there or not.
    pub(super) fn ordered(
        &self,
        name: &str,
        sizes: &[usize],
        meaning: &'static str,
    ) -> Result<Vec<Complex<f64>>, ResponseFault> {
        let long = |sizes: &mut dyn Iterator<Item = u64>| -> Vec<u64> { sizes.filter(|n| *n != 1).collect() };
        let own = long(&mut self.shape.iter().copied());
        let wanted = long(&mut sizes.iter().map(|n| *n as u64));
        let count: usize = sizes.iter().product();
        if own != wanted || self.re.len() != count || self.im.as_ref().is_some_and(|im| im.len() != count) {
            return Err(ResponseFault::Shape {
                name: name.to_owned(),
                found: self.shape.clone(),
                needed: sizes.to_vec(),
                meaning,
            });
        }
        let wanted: Vec<usize> = wanted.iter().map(|n| *n as usize).collect();
        let value = |at: usize| Complex::new(self.re[at], self.im.as_ref().map_or(0.0, |im| im[at]));
        Ok((0..count)
            .map(|at| match self.last_fastest {
                true => value(at),
                false => value(first_fastest(at, &wanted)),
            })
            .collect())
    }
}

/// The place of an entry counted with the last index fastest, where the first is.
fn first_fastest(mut at: usize, sizes: &[usize]) -> usize {
    let mut place = 0;
    for (k, n) in sizes.iter().enumerate().rev() {
        place += (at % n) * sizes[..k].iter().product::<usize>();
        at /= n;
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_orders_by_hand() {
        // x(k, i) = 10 k + i, of size 2 x 3.
        let numbers = |last_fastest: bool, re: &[f64]| Numbers {
            shape: vec![2, 1, 3],
            last_fastest,
            re: re.to_vec(),
            im: Some(vec![1.0; 6]),
        };
        let all = [0.0, 1.0, 2.0, 10.0, 11.0, 12.0];
        for n in [
            numbers(true, &all),
            numbers(false, &[0.0, 10.0, 1.0, 11.0, 2.0, 12.0]),
        ] {
            let found = n.ordered("x", &[2, 3, 1], "").unwrap();
            assert_eq!(found.iter().map(|v| v.re).collect::<Vec<_>>(), all);
            assert!(n.ordered("x", &[3, 2], "").is_err());
            assert!(n.ordered("x", &[6], "").is_err());
        }
        let empty = Numbers {
            shape: vec![0, 1],
            last_fastest: false,
            re: Vec::new(),
            im: None,
        };
        assert!(empty.ordered("x", &[0], "").unwrap().is_empty());
    }
}
