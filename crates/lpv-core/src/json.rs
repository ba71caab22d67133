//! Models as JSON, with a schema that says which version it is.

use crate::{
    Clock, CoreError, DeltaBlock, Discrete, FunctionBasis, InnovationModel, Lfr, LfrBlocks, LpvStateSpace,
    MatrixFunction, Model, RigidBody, RigidBodyAxis, SchedulingRange, SeriesExpansion, StateSpace,
};
use nalgebra::{DMatrix, DVector};
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The schema version that this crate writes and reads.
pub const MODEL_VERSION: u32 = 1;

#[derive(Serialize)]
struct File<'a> {
    format: &'static str,
    version: u32,
    #[serde(flatten)]
    model: &'a Model,
}

#[derive(Deserialize)]
struct Header {
    format: String,
    version: u32,
}

impl Model {
    /// The model as JSON text; numbers survive the round trip bit by bit.
    ///
    /// # Errors
    /// [`CoreError::Json`] if the serialiser fails, which finite numbers do not make it do.
    pub fn to_json(&self) -> Result<String, CoreError> {
        let file = File {
            format: "lpv-model",
            version: MODEL_VERSION,
            model: self,
        };
        serde_json::to_string_pretty(&file).map_err(json_error)
    }

    /// Reads what [`Model::to_json`] wrote, with every check of the constructors.
    ///
    /// # Errors
    /// [`CoreError::Json`] with line and column, [`CoreError::Schema`] for another format or version.
    pub fn from_json(text: &str) -> Result<Self, CoreError> {
        let header: Header = serde_json::from_str(text).map_err(json_error)?;
        if header.format != "lpv-model" || header.version != MODEL_VERSION {
            return Err(CoreError::Schema {
                format: header.format,
                version: header.version,
                supported: MODEL_VERSION,
            });
        }
        serde_json::from_str(text).map_err(json_error)
    }
}

fn json_error(e: serde_json::Error) -> CoreError {
    CoreError::Json {
        line: e.line(),
        column: e.column(),
        message: e.to_string(),
    }
}

/// A matrix as its shape and its rows: the shape is needed where one dimension is zero.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Rows {
    shape: (usize, usize),
    rows: Vec<Vec<f64>>,
}

impl From<&DMatrix<f64>> for Rows {
    fn from(m: &DMatrix<f64>) -> Self {
        Self {
            shape: m.shape(),
            rows: m.row_iter().map(|r| r.iter().copied().collect()).collect(),
        }
    }
}

impl Rows {
    fn matrix<E: serde::de::Error>(self) -> Result<DMatrix<f64>, E> {
        let (rows, columns) = self.shape;
        if self.rows.len() != rows {
            return Err(E::custom(format!(
                "matrix of shape {rows} x {columns} has {} rows",
                self.rows.len()
            )));
        }
        if let Some((i, r)) = self.rows.iter().enumerate().find(|(_, r)| r.len() != columns) {
            return Err(E::custom(format!(
                "matrix of shape {rows} x {columns}: row {i} has {} entries",
                r.len()
            )));
        }
        if rows == 0 && columns > 1 << 20 {
            return Err(E::custom(format!(
                "matrix of shape {rows} x {columns} is too wide"
            )));
        }
        Ok(DMatrix::from_row_iterator(
            rows,
            columns,
            self.rows.into_iter().flatten(),
        ))
    }
}

/// Serialises named parts of a type through a plain mirror of it, and deserialises through its checked constructor.
macro_rules! mirror {
    ($name:ident, $mirror:ident { $($field:ident : $kind:ty),* $(,)? }, $out:expr, $into:expr) => {
        #[derive(Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        struct $mirror { $($field: $kind),* }
        impl Serialize for $name {
            fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
                let out: fn(&$name) -> $mirror = $out;
                out(self).serialize(s)
            }
        }
        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
                let into: fn($mirror) -> Result<$name, D::Error> = $into;
                into($mirror::deserialize(d)?)
            }
        }
    };
}

/// As `mirror!`, for types with a clock; continuous time is written as `null`, discrete time as its sample time.
macro_rules! clocked_mirror {
    ($name:ident, $mirror:ident { $($field:ident : $kind:ty),* $(,)? }, $self:ident => $out:expr, $m:ident => $into:expr) => {
        #[derive(Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        struct $mirror<K> { sample_time: K, $($field: $kind),* }
        impl<K: Clock + Serialize> Serialize for $name<K> {
            fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
                let $self = self;
                $out.serialize(s)
            }
        }
        impl<'de, K: Clock + DeserializeOwned> Deserialize<'de> for $name<K> {
            fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
                let $m = $mirror::<K>::deserialize(d)?;
                $into.map_err(D::Error::custom)
            }
        }
    };
}

mirror!(MatrixFunction, FunctionMirror { basis: FunctionBasis, coefficients: Vec<Rows> },
|f| FunctionMirror {
    basis: f.basis().clone(),
    coefficients: f.coefficients().iter().map(Rows::from).collect(),
},
|m| {
    let coefficients = m.coefficients.into_iter().map(Rows::matrix).collect::<Result<_, D::Error>>()?;
    MatrixFunction::new(m.basis, coefficients).map_err(D::Error::custom)
});

mirror!(SeriesExpansion, SeriesMirror {
        rigid_body: StateSpace<Discrete>,
        basis: StateSpace<Discrete>,
        direct: MatrixFunction,
        weights: MatrixFunction,
        range: SchedulingRange,
    },
    |e| SeriesMirror {
        rigid_body: e.rigid_body().clone(),
        basis: e.basis().clone(),
        direct: e.direct().clone(),
        weights: e.weights().clone(),
        range: e.range().clone(),
    },
    |m| SeriesExpansion::new(m.rigid_body, m.basis, m.direct, m.weights, m.range).map_err(D::Error::custom));

mirror!(InnovationModel, InnovationMirror {
        system: StateSpace<Discrete>,
        gain: Rows,
        innovation_covariance: Rows,
        input_offset: Vec<f64>,
        output_offset: Vec<f64>,
    },
    |m| InnovationMirror {
        system: m.model().clone(),
        gain: m.gain().into(),
        innovation_covariance: m.innovation_covariance().into(),
        input_offset: m.input_offset().iter().copied().collect(),
        output_offset: m.output_offset().iter().copied().collect(),
    },
    |m| InnovationModel::new(
        m.system, m.gain.matrix()?, m.innovation_covariance.matrix()?,
        DVector::from_vec(m.input_offset), DVector::from_vec(m.output_offset),
    ).map_err(D::Error::custom));

mirror!(RigidBody, RigidBodyMirror { axes: Vec<RigidBodyAxis> },
    |m| RigidBodyMirror { axes: m.axes().to_vec() },
    |m| RigidBody::new(m.axes).map_err(D::Error::custom));

clocked_mirror!(StateSpace, StateSpaceMirror { a: Rows, b: Rows, c: Rows, d: Rows },
    s => StateSpaceMirror {
        sample_time: s.clock(),
        a: s.a().into(), b: s.b().into(), c: s.c().into(), d: s.d().into(),
    },
    m => StateSpace::new(m.a.matrix()?, m.b.matrix()?, m.c.matrix()?, m.d.matrix()?, m.sample_time));

clocked_mirror!(LpvStateSpace, LpvMirror {
        range: SchedulingRange, a: MatrixFunction, b: MatrixFunction, c: MatrixFunction, d: MatrixFunction,
    },
    s => LpvMirror {
        sample_time: s.clock(), range: s.range().clone(),
        a: s.a().clone(), b: s.b().clone(), c: s.c().clone(), d: s.d().clone(),
    },
    m => LpvStateSpace::new(m.a, m.b, m.c, m.d, m.range, m.sample_time));

clocked_mirror!(Lfr, LfrMirror {
        range: SchedulingRange, deltas: Vec<DeltaBlock>,
        a: Rows, b1: Rows, b2: Rows, c1: Rows, d11: Rows, d12: Rows, c2: Rows, d21: Rows, d22: Rows,
    },
    s => {
        let b = s.blocks();
        LfrMirror {
            sample_time: s.clock(), range: s.range().clone(), deltas: s.deltas().to_vec(),
            a: (&b.a).into(), b1: (&b.b1).into(), b2: (&b.b2).into(),
            c1: (&b.c1).into(), d11: (&b.d11).into(), d12: (&b.d12).into(),
            c2: (&b.c2).into(), d21: (&b.d21).into(), d22: (&b.d22).into(),
        }
    },
    m => Lfr::new(
        LfrBlocks {
            a: m.a.matrix()?, b1: m.b1.matrix()?, b2: m.b2.matrix()?,
            c1: m.c1.matrix()?, d11: m.d11.matrix()?, d12: m.d12.matrix()?,
            c2: m.c2.matrix()?, d21: m.d21.matrix()?, d22: m.d22.matrix()?,
        },
        m.deltas, m.range, m.sample_time));
