//! What other programs than MATLAB write beside their data sets: units and settings.

use super::MOST_VARIABLES;
use crate::contents::{MOST_SCALARS, Scalar};
use crate::mat::DEEPEST;
use hdf5_pure::{AttrValue, Error, Group};
use std::collections::HashMap;

/// Attributes of a file.
#[derive(Debug, Default)]
pub(in crate::mat) struct Attributes {
    /// Units by data set.
    pub(in crate::mat) units: HashMap<String, String>,
    /// Single numbers of groups and data sets, with the names of these in front.
    pub(in crate::mat) scalars: Vec<Scalar>,
    seen: usize,
}

const UNITS: [&str; 4] = ["unit", "units", "Unit", "Units"];

impl Attributes {
    pub(super) fn read(root: &Group) -> Result<Self, Error> {
        let mut all = Self::default();
        all.group(root, "", 0)?;
        Ok(all)
    }

    fn group(&mut self, group: &Group, path: &str, depth: usize) -> Result<(), Error> {
        self.settings(path, &group.attrs()?);
        for (own, dataset) in group.iter_datasets()? {
            let name = format!("{path}{own}");
            let attributes = dataset.attrs()?;
            if let Some(unit) = UNITS.iter().find_map(|u| attributes.get(*u)?.as_str()) {
                self.units.insert(name.clone(), unit.trim().to_owned());
            }
            self.settings(&format!("{name}."), &attributes);
            self.seen += 1;
        }
        for (own, inner) in group.iter_groups()? {
            self.seen += 1;
            if depth + 1 < DEEPEST && self.seen < MOST_VARIABLES {
                self.group(&inner, &format!("{path}{own}."), depth + 1)?;
            }
        }
        Ok(())
    }

    /// Takes the numbers, by name: the order of a hash map is none.
    fn settings(&mut self, path: &str, attributes: &HashMap<String, AttrValue>) {
        let mut numbers: Vec<Scalar> = attributes
            .iter()
            .filter_map(|(name, value)| {
                let value = value.as_f64().or_else(|| value.as_i64().map(|v| v as f64))?;
                value.is_finite().then(|| Scalar {
                    name: format!("{path}{name}"),
                    value,
                })
            })
            .collect();
        numbers.sort_by(|a, b| a.name.cmp(&b.name));
        let left = MOST_SCALARS.saturating_sub(self.scalars.len());
        self.scalars.extend(numbers.into_iter().take(left));
    }
}
