//! Complex numbers on the lines, real and imaginary parts apart: many lines go through a register at a time.

use num_complex::Complex;
use std::ops::Range;

type C64 = Complex<f64>;

/// Complex columns with one entry a line; of each column first all real parts, then all imaginary ones.
#[derive(Debug, Clone)]
pub(crate) struct Columns {
    lines: usize,
    values: Vec<f64>,
}

impl Columns {
    pub(crate) fn zeros(lines: usize, count: usize) -> Self {
        let values = vec![0.0; 2 * lines * count];
        Self { lines, values }
    }

    /// A single column.
    pub(crate) fn single(values: &[C64]) -> Self {
        let (re, im) = (values.iter().map(|v| v.re), values.iter().map(|v| v.im));
        Self {
            lines: values.len(),
            values: re.chain(im).collect(),
        }
    }

    /// Columns whose parts follow each other in the order in which this type keeps them.
    pub(crate) fn from_parts(lines: usize, values: Vec<f64>) -> Self {
        Self { lines, values }
    }

    pub(crate) fn lines(&self) -> usize {
        self.lines
    }

    pub(crate) fn count(&self) -> usize {
        self.values.len() / (2 * self.lines)
    }

    /// Both parts of all columns.
    pub(crate) fn parts(&self) -> &[f64] {
        &self.values
    }

    pub(crate) fn parts_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Real parts of a column followed by its imaginary ones.
    pub(crate) fn whole(&self, column: usize) -> &[f64] {
        &self.values[2 * self.lines * column..2 * self.lines * (column + 1)]
    }

    pub(crate) fn whole_mut(&mut self, column: usize) -> &mut [f64] {
        &mut self.values[2 * self.lines * column..2 * self.lines * (column + 1)]
    }

    /// Real and imaginary parts of a column.
    pub(crate) fn column(&self, column: usize) -> Parts<'_> {
        self.whole(column).split_at(self.lines)
    }

    pub(crate) fn column_mut(&mut self, column: usize) -> PartsMut<'_> {
        let lines = self.lines;
        self.whole_mut(column).split_at_mut(lines)
    }

    /// Both parts of a column on some lines.
    pub(crate) fn part(&self, column: usize, lines: &Range<usize>) -> Parts<'_> {
        let (re, im) = self.column(column);
        (&re[lines.clone()], &im[lines.clone()])
    }

    pub(crate) fn part_mut(&mut self, column: usize, lines: &Range<usize>) -> PartsMut<'_> {
        let (re, im) = self.column_mut(column);
        (&mut re[lines.clone()], &mut im[lines.clone()])
    }

    /// The number of a column on a line.
    pub(crate) fn at(&self, line: usize, column: usize) -> C64 {
        let (re, im) = self.column(column);
        C64::new(re[line], im[line])
    }

    pub(crate) fn set(&mut self, line: usize, column: usize, value: C64) {
        let (re, im) = self.column_mut(column);
        (re[line], im[line]) = (value.re, value.im);
    }

    /// `sum_j factors[j] column_j`, into both parts of a column.
    pub(crate) fn combine(&self, factors: &[f64], sum: &mut [f64]) {
        sum.fill(0.0);
        for (factor, column) in factors.iter().zip(self.values.chunks_exact(2 * self.lines)) {
            axpy(*factor, column, sum);
        }
    }
}

/// Parts of the lines whose columns stay near the processor.
pub(crate) fn blocks(lines: usize) -> impl Iterator<Item = Range<usize>> {
    const BLOCK: usize = 64;
    (0..lines.div_ceil(BLOCK)).map(move |i| i * BLOCK..lines.min((i + 1) * BLOCK))
}

/// Real and imaginary parts.
pub(crate) type Parts<'a> = (&'a [f64], &'a [f64]);
/// The same, to be written.
pub(crate) type PartsMut<'a> = (&'a mut [f64], &'a mut [f64]);

/// Makes a function run with the widest registers of the machine. What it calls must be inlined into it.
macro_rules! wide {
    ($(#[$doc:meta])* fn $name:ident($($argument:ident: $kind:ty),*) -> $output:ty $body:block) => {
        $(#[$doc])*
        pub(crate) fn $name<'a>($($argument: $kind),*) -> $output {
            struct Work<'a>($($kind),*);
            impl<'a> pulp::WithSimd for Work<'a> {
                type Output = $output;

                #[inline(always)]
                fn with_simd<S: pulp::Simd>(self, _simd: S) -> $output {
                    let Self($($argument),*) = self;
                    $body
                }
            }
            pulp::Arch::new().dispatch(Work($($argument),*))
        }
    };
}
pub(crate) use wide;

wide! {
    /// Eight partial sums: the order of additions is fixed, whatever the registers of the machine.
    fn dot(x: &'a [f64], y: &'a [f64]) -> f64 {
        let mut sums = [0.0; 8];
        let ((x8, x), (y8, y)) = (x.as_chunks::<8>(), y.as_chunks::<8>());
        for (a, b) in x8.iter().zip(y8) {
            for i in 0..8 {
                sums[i] += a[i] * b[i];
            }
        }
        let tail: f64 = x.iter().zip(y).map(|(a, b)| a * b).sum();
        sums.iter().sum::<f64>() + tail
    }
}

wide! {
    /// `y + factor x`, into `y`.
    fn axpy(factor: f64, x: &'a [f64], y: &'a mut [f64]) -> () {
        for (y, x) in y.iter_mut().zip(x) {
            *y += factor * x;
        }
    }
}

wide! {
    /// `to + x y` of real numbers, into `to`.
    fn add_real_product(x: &'a [f64], y: &'a [f64], to: &'a mut [f64]) -> () {
        for ((x, y), to) in x.iter().zip(y).zip(to) {
            *to += x * y;
        }
    }
}

wide! {
    /// `x y` of real numbers, into `to`.
    fn real_product(x: &'a [f64], y: &'a [f64], to: &'a mut [f64]) -> () {
        for ((x, y), to) in x.iter().zip(y).zip(to) {
            *to = x * y;
        }
    }
}

wide! {
    /// `|x|^2`, into `to`.
    fn square(x: Parts<'a>, to: &'a mut [f64]) -> () {
        for ((re, im), to) in x.0.iter().zip(x.1).zip(to) {
            *to = re * re + im * im;
        }
    }
}

/// Sets each number of `to` from those of `x`, `y` and its own.
#[inline(always)]
pub(crate) fn each(
    x: Parts<'_>,
    y: Parts<'_>,
    to: PartsMut<'_>,
    one: impl Fn([f64; 2], [f64; 2], [f64; 2]) -> [f64; 2],
) {
    let from = x.0.iter().zip(x.1).zip(y.0.iter().zip(y.1));
    for (((a, b), (c, d)), (re, im)) in from.zip(to.0.iter_mut().zip(to.1)) {
        [*re, *im] = one([*a, *b], [*c, *d], [*re, *im]);
    }
}

wide! {
    /// `x y`, into `to`.
    fn product(x: Parts<'a>, y: Parts<'a>, to: PartsMut<'a>) -> () {
        each(x, y, to, |[a, b], [c, d], _| [a * c - b * d, a * d + b * c]);
    }
}

wide! {
    /// `conj(x) y`, into `to`.
    fn conjugate_product(x: Parts<'a>, y: Parts<'a>, to: PartsMut<'a>) -> () {
        each(x, y, to, |[a, b], [c, d], _| [a * c + b * d, a * d - b * c]);
    }
}

wide! {
    /// `to + x y`, into `to`.
    fn add_product(x: Parts<'a>, y: Parts<'a>, to: PartsMut<'a>) -> () {
        each(x, y, to, |[a, b], [c, d], [re, im]| [re + a * c - b * d, im + a * d + b * c]);
    }
}

wide! {
    /// `to + conj(x) y`, into `to`.
    fn add_conjugate_product(x: Parts<'a>, y: Parts<'a>, to: PartsMut<'a>) -> () {
        each(x, y, to, |[a, b], [c, d], [re, im]| [re + a * c + b * d, im + a * d - b * c]);
    }
}
