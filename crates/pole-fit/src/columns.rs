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

    /// `sum_j factors[j] column_j`, into both parts of a column; or of several, each with as many factors.
    pub(crate) fn combine(&self, factors: &[f64], sums: &mut [f64]) {
        let length = 2 * self.lines;
        let count = factors.len() / (sums.len() / length);
        combine(&self.values, length, count, factors, sums);
    }
}

/// Parts of the lines whose columns stay near the processor.
pub(crate) fn blocks(lines: usize) -> impl Iterator<Item = Range<usize>> {
    const LINES: usize = 64;
    (0..lines.div_ceil(LINES)).map(move |i| i * LINES..lines.min((i + 1) * LINES))
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

/// Partial sums, enough that few additions wait for another: their order is fixed, whatever the registers of the machine.
pub(crate) type Sums = [f64; LANES];
const LANES: usize = 16;
/// Before the first product.
pub(crate) const NOTHING: Sums = [0.0; LANES];

/// Adds the products of both to the partial sums.
#[inline(always)]
pub(crate) fn add_dot(x: &[f64], y: &[f64], sums: &mut Sums) {
    let mut all = *sums;
    let ((x_all, x), (y_all, y)) = (x.as_chunks::<LANES>(), y.as_chunks::<LANES>());
    for (a, b) in x_all.iter().zip(y_all) {
        for i in 0..LANES {
            all[i] += a[i] * b[i];
        }
    }
    for ((a, b), sum) in x.iter().zip(y).zip(&mut all) {
        *sum += a * b;
    }
    *sums = all;
}

/// Each of some sums.
pub(crate) fn totals(sums: &[Sums]) -> Vec<f64> {
    sums.iter().map(|sums| sums.iter().sum()).collect()
}

wide! {
    /// `x^T y`.
    fn dot(x: &'a [f64], y: &'a [f64]) -> f64 {
        let mut sums = NOTHING;
        add_dot(x, y, &mut sums);
        sums.iter().sum()
    }
}

/// Numbers of each column that are near the processor while others pass.
pub(crate) const BLOCK: usize = 256;

/// Adds the multiples of a block of each column of this length to that of `x`.
#[inline(always)]
pub(crate) fn add_multiples(
    columns: &[f64],
    length: usize,
    start: usize,
    factors: &[f64],
    sign: f64,
    x: &mut [f64],
) {
    let count = x.len();
    let of = |column: usize| &columns[column * length + start..][..count];
    // Four at a time: what they add to is read and written once.
    let (fours, rest) = factors.as_chunks::<4>();
    for (i, f) in fours.iter().enumerate() {
        let [a, b, c, d] = [of(4 * i), of(4 * i + 1), of(4 * i + 2), of(4 * i + 3)];
        let f = f.map(|f| sign * f);
        for ((((x, a), b), c), d) in x.iter_mut().zip(a).zip(b).zip(c).zip(d) {
            *x += (f[0] * a + f[1] * b) + (f[2] * c + f[3] * d);
        }
    }
    for (i, f) in rest.iter().enumerate() {
        let f = sign * f;
        for (x, a) in x.iter_mut().zip(of(4 * fours.len() + i)) {
            *x += f * a;
        }
    }
}

/// Adds the products of a block of each column of this length with that of `x` to the sums.
#[inline(always)]
pub(crate) fn add_correlations(columns: &[f64], length: usize, start: usize, x: &[f64], sums: &mut [Sums]) {
    for (sums, column) in sums.iter_mut().zip(columns.chunks_exact(length)) {
        add_dot(&column[start..start + x.len()], x, sums);
    }
}

wide! {
    /// So many sums of products with the columns for each of `x`.
    fn correlate(columns: &'a [f64], length: usize, count: usize, x: &'a [f64]) -> Vec<f64> {
        let mut sums = vec![NOTHING; count * (x.len() / length)];
        for start in (0..length).step_by(BLOCK) {
            for (sums, x) in sums.chunks_mut(count.max(1)).zip(x.chunks_exact(length)) {
                add_correlations(columns, length, start, &x[start..length.min(start + BLOCK)], sums);
            }
        }
        totals(&sums)
    }
}

wide! {
    /// The sum of so many columns with the factors of each of `sums`, into them.
    fn combine(columns: &'a [f64], length: usize, count: usize, factors: &'a [f64], sums: &'a mut [f64]) -> () {
        for start in (0..length).step_by(BLOCK) {
            for (i, sum) in sums.chunks_exact_mut(length).enumerate() {
                let factors = &factors[i * count..(i + 1) * count];
                let sum = &mut sum[start..length.min(start + BLOCK)];
                sum.fill(0.0);
                add_multiples(columns, length, start, factors, 1.0, sum);
            }
        }
    }
}

wide! {
    /// `factor x`, into `x`.
    fn scale(factor: f64, x: &'a mut [f64]) -> () {
        for x in x {
            *x *= factor;
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
