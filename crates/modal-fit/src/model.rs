//! The model, its parameters, and how its response moves with them.

use lpv_core::Discrete;
use nalgebra::DMatrix;
use num_complex::Complex;

type C64 = Complex<f64>;

/// The rigid body behind the hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rigid {
    /// `T / (z - 1)`.
    One,
    /// `(T^2/2) (z + 1) / (z - 1)^2`.
    Two,
}

impl Rigid {
    pub(crate) fn response(self, z: C64, clock: Discrete) -> C64 {
        let t = clock.sample_time();
        match self {
            Self::One => (z - 1.0).inv() * t,
            Self::Two => (z + 1.0) / ((z - 1.0) * (z - 1.0)) * (0.5 * t * t),
        }
    }
}

/// `C B^T / (z - l)`, with its conjugate if the pole is complex.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Section {
    pub(crate) pole: C64,
    /// `n_y x r`.
    pub(crate) c: DMatrix<C64>,
    /// `n_u x r`.
    pub(crate) b: DMatrix<C64>,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Modal {
    pub(crate) sections: Vec<Section>,
    pub(crate) rigid: Option<(Rigid, DMatrix<f64>, DMatrix<f64>)>,
    pub(crate) direct: Option<DMatrix<f64>>,
    pub(crate) shape: (usize, usize),
}

/// Rows of a factor that are held: the square block there stays as it is, so that no change of coordinates is left.
fn held<T: nalgebra::ComplexField<RealField = f64>>(b: &DMatrix<T>) -> Vec<usize> {
    let mut rest = b.clone();
    let mut rows = Vec::with_capacity(b.ncols());
    for _ in 0..b.ncols() {
        let free = (0..b.nrows()).filter(|i| !rows.contains(i));
        let Some(row) = free.max_by(|&i, &j| rest.row(i).norm().total_cmp(&rest.row(j).norm())) else {
            break;
        };
        rows.push(row);
        // What is left of the other rows beside this one.
        let own = rest.row(row).clone_owned();
        let size = own.norm_squared();
        if size > 0.0 {
            for i in 0..b.nrows() {
                let along = rest.row(i).dotc(&own).conjugate().scale(1.0 / size);
                let taken = &own * along;
                let mut target = rest.row_mut(i);
                target -= taken;
            }
        }
    }
    rows
}

/// An outer product: a factor, the column, the row.
type Outer<'a> = (C64, &'a [C64], &'a dyn Fn(usize) -> C64);

/// One real parameter.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Parameter {
    Pole {
        section: usize,
        imaginary: bool,
    },
    C {
        section: usize,
        row: usize,
        column: usize,
        imaginary: bool,
    },
    B {
        section: usize,
        row: usize,
        column: usize,
        imaginary: bool,
    },
    RigidC {
        row: usize,
        column: usize,
    },
    RigidB {
        row: usize,
        column: usize,
    },
    Direct {
        row: usize,
        column: usize,
    },
}

impl Modal {
    /// The parameters, in the order of the columns of a Jacobian.
    pub(crate) fn parameters(&self) -> Vec<Parameter> {
        let (n_y, n_u) = self.shape;
        let mut all = Vec::new();
        for (section, of) in self.sections.iter().enumerate() {
            let parts: &[bool] = if of.pole.im == 0.0 {
                &[false]
            } else {
                &[false, true]
            };
            all.extend(
                parts
                    .iter()
                    .map(|&imaginary| Parameter::Pole { section, imaginary }),
            );
            let rows = held(&of.b);
            for column in 0..of.c.ncols() {
                for row in 0..n_y {
                    all.extend(parts.iter().map(|&imaginary| Parameter::C {
                        section,
                        row,
                        column,
                        imaginary,
                    }));
                }
                for row in (0..n_u).filter(|row| !rows.contains(row)) {
                    all.extend(parts.iter().map(|&imaginary| Parameter::B {
                        section,
                        row,
                        column,
                        imaginary,
                    }));
                }
            }
        }
        if let Some((_, c, b)) = &self.rigid {
            let rows = held(b);
            for column in 0..c.ncols() {
                all.extend((0..n_y).map(|row| Parameter::RigidC { row, column }));
                let free = (0..n_u).filter(|row| !rows.contains(row));
                all.extend(free.map(|row| Parameter::RigidB { row, column }));
            }
        }
        if self.direct.is_some() {
            for column in 0..n_u {
                all.extend((0..n_y).map(|row| Parameter::Direct { row, column }));
            }
        }
        all
    }

    /// Ranks of the residues, that of the rigid body last.
    pub(crate) fn ranks(&self) -> Vec<usize> {
        let rigid = self.rigid.as_ref().map_or(0, |(_, c, _)| c.ncols());
        self.sections.iter().map(|s| s.c.ncols()).chain([rigid]).collect()
    }

    /// The model with a step of its parameters.
    pub(crate) fn moved(&self, parameters: &[Parameter], step: &[f64]) -> Self {
        let mut next = self.clone();
        for (parameter, d) in parameters.iter().zip(step) {
            let part = |imaginary: bool| {
                if imaginary {
                    C64::new(0.0, *d)
                } else {
                    C64::from(*d)
                }
            };
            match *parameter {
                Parameter::Pole { section, imaginary } => next.sections[section].pole += part(imaginary),
                Parameter::C {
                    section,
                    row,
                    column,
                    imaginary,
                } => {
                    next.sections[section].c[(row, column)] += part(imaginary);
                }
                Parameter::B {
                    section,
                    row,
                    column,
                    imaginary,
                } => {
                    next.sections[section].b[(row, column)] += part(imaginary);
                }
                Parameter::RigidC { row, column } => {
                    if let Some((_, c, _)) = &mut next.rigid {
                        c[(row, column)] += d;
                    }
                }
                Parameter::RigidB { row, column } => {
                    if let Some((_, _, b)) = &mut next.rigid {
                        b[(row, column)] += d;
                    }
                }
                Parameter::Direct { row, column } => {
                    if let Some(direct) = &mut next.direct {
                        direct[(row, column)] += d;
                    }
                }
            }
        }
        next
    }

    /// The response at a point, `n_y x n_u`.
    pub(crate) fn response(&self, z: C64, clock: Discrete) -> DMatrix<C64> {
        let (n_y, n_u) = self.shape;
        let mut f = match &self.direct {
            Some(direct) => direct.map(C64::from),
            None => DMatrix::zeros(n_y, n_u),
        };
        if let Some((kind, c, b)) = &self.rigid {
            f += (c * b.transpose()).map(C64::from) * kind.response(z, clock);
        }
        for section in &self.sections {
            let residue = &section.c * section.b.transpose();
            if section.pole.im == 0.0 {
                f += residue * (z - section.pole).inv();
            } else {
                f += residue.conjugate() * (z - section.pole.conj()).inv();
                f += residue * (z - section.pole).inv();
            }
        }
        f
    }

    /// Derivatives of `left F right` with respect to the parameters, written one after the other into `columns`, `n_y n_u`
    /// values each, column-major.
    pub(crate) fn derivatives(
        &self,
        parameters: &[Parameter],
        z: C64,
        clock: Discrete,
        (left, right): (&DMatrix<C64>, &DMatrix<C64>),
        columns: &mut [C64],
    ) {
        let (n_y, n_u) = self.shape;
        let size = n_y * n_u;
        // What a section is made of, once a line: phi, phi of the conjugate, left c and b^T right of both.
        struct Parts {
            phi: [C64; 2],
            left: [DMatrix<C64>; 2],
            right: [DMatrix<C64>; 2],
        }
        let parts: Vec<Parts> = self
            .sections
            .iter()
            .map(|s| Parts {
                phi: [(z - s.pole).inv(), (z - s.pole.conj()).inv()],
                left: [left * &s.c, left * s.c.conjugate()],
                right: [s.b.transpose() * right, s.b.adjoint() * right],
            })
            .collect();
        let phi = self
            .rigid
            .as_ref()
            .map_or(C64::from(0.0), |(kind, _, _)| kind.response(z, clock));
        let rigid = self
            .rigid
            .as_ref()
            .map(|(_, c, b)| (left * c.map(C64::from), b.transpose().map(C64::from) * right));
        let both = |imaginary: bool| {
            if imaginary {
                (C64::i(), -C64::i())
            } else {
                (C64::from(1.0), C64::from(1.0))
            }
        };
        for (parameter, to) in parameters.iter().zip(columns.chunks_exact_mut(size)) {
            // Sum of outer products.
            let mut put = |terms: &[Outer<'_>]| {
                for j in 0..n_u {
                    for (i, to) in to[j * n_y..(j + 1) * n_y].iter_mut().enumerate() {
                        *to = terms.iter().map(|(factor, l, r)| factor * l[i] * r(j)).sum();
                    }
                }
            };
            match *parameter {
                Parameter::Pole { section, imaginary } => {
                    let (s, p) = (&self.sections[section], &parts[section]);
                    let (first, second) = both(imaginary);
                    to.fill(C64::from(0.0));
                    for column in 0..s.c.ncols() {
                        for j in 0..n_u {
                            for i in 0..n_y {
                                let mut v = first
                                    * p.phi[0]
                                    * p.phi[0]
                                    * p.left[0][(i, column)]
                                    * p.right[0][(column, j)];
                                if s.pole.im != 0.0 {
                                    v += second
                                        * p.phi[1]
                                        * p.phi[1]
                                        * p.left[1][(i, column)]
                                        * p.right[1][(column, j)];
                                }
                                to[j * n_y + i] += v;
                            }
                        }
                    }
                }
                Parameter::C {
                    section,
                    row,
                    column,
                    imaginary,
                } => {
                    let (s, p) = (&self.sections[section], &parts[section]);
                    let (first, second) = both(imaginary);
                    let own = &left.as_slice()[row * n_y..(row + 1) * n_y];
                    if s.pole.im == 0.0 {
                        put(&[(p.phi[0], own, &|j| p.right[0][(column, j)])]);
                    } else {
                        put(&[(C64::from(1.0), own, &|j| {
                            first * p.phi[0] * p.right[0][(column, j)]
                                + second * p.phi[1] * p.right[1][(column, j)]
                        })]);
                    }
                }
                Parameter::B {
                    section,
                    row,
                    column,
                    imaginary,
                } => {
                    let (s, p) = (&self.sections[section], &parts[section]);
                    let (first, second) = both(imaginary);
                    let of = |which: usize| &p.left[which].as_slice()[column * n_y..(column + 1) * n_y];
                    if s.pole.im == 0.0 {
                        put(&[(p.phi[0], of(0), &|j| right[(row, j)])]);
                    } else {
                        put(&[
                            (first * p.phi[0], of(0), &|j| right[(row, j)]),
                            (second * p.phi[1], of(1), &|j| right[(row, j)]),
                        ]);
                    }
                }
                Parameter::RigidC { row, column } => {
                    if let Some((_, r)) = &rigid {
                        let own = &left.as_slice()[row * n_y..(row + 1) * n_y];
                        put(&[(phi, own, &|j| r[(column, j)])]);
                    }
                }
                Parameter::RigidB { row, column } => {
                    if let Some((l, _)) = &rigid {
                        let own = &l.as_slice()[column * n_y..(column + 1) * n_y];
                        put(&[(phi, own, &|j| right[(row, j)])]);
                    }
                }
                Parameter::Direct { row, column } => {
                    let own = &left.as_slice()[row * n_y..(row + 1) * n_y];
                    put(&[(C64::from(1.0), own, &|j| right[(column, j)])]);
                }
            }
        }
    }
}
