//! Formulas: read once, evaluated at every instant of a simulation.
//!
//! A power binds tighter than a sign, and to the right: `-x^2` is `-(x^2)`, `2^3^2` is `2^9`, as in Python and in print.

/// A formula as a list of operations on a stack.
#[derive(Debug, Clone)]
pub(super) struct Formula {
    operations: Vec<Operation>,
    names: Vec<String>,
}

#[derive(Debug, Clone, Copy)]
enum Operation {
    Number(f64),
    /// By its place among the names.
    Variable(usize),
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    /// To a whole power, as a product.
    Whole(i32),
    One(OfOne),
    Two(OfTwo),
}

type OfOne = fn(f64) -> f64;
type OfTwo = fn(f64, f64) -> f64;

/// Functions of one number.
const ONE: [(&str, OfOne); 22] = [
    ("abs", f64::abs),
    ("signum", f64::signum),
    ("sqrt", f64::sqrt),
    ("cbrt", f64::cbrt),
    ("exp", f64::exp),
    ("ln", f64::ln),
    ("log10", f64::log10),
    ("log2", f64::log2),
    ("sin", f64::sin),
    ("cos", f64::cos),
    ("tan", f64::tan),
    ("asin", f64::asin),
    ("acos", f64::acos),
    ("atan", f64::atan),
    ("sinh", f64::sinh),
    ("cosh", f64::cosh),
    ("tanh", f64::tanh),
    ("asinh", f64::asinh),
    ("floor", f64::floor),
    ("ceil", f64::ceil),
    ("round", f64::round),
    ("fract", f64::fract),
];
/// Functions of two.
const TWO: [(&str, OfTwo); 3] = [("atan2", f64::atan2), ("min", f64::min), ("max", f64::max)];
const PI: [&str; 2] = ["pi", "PI"];
/// What functions of other languages are called here.
const MEANT: [(&str, &str); 5] = [
    ("sign", "`signum`"),
    ("sgn", "`signum`"),
    ("log", "`ln` or `log10`"),
    ("pow", "`a^b`"),
    ("arctan", "`atan`"),
];

/// Whether a name means something in every formula.
pub(super) fn is_taken(name: &str) -> bool {
    PI.contains(&name) || ONE.iter().any(|(n, _)| *n == name) || TWO.iter().any(|(n, _)| *n == name)
}

/// Numbers that stand on the stack at once.
const DEPTH: usize = 32;
/// Characters of a formula.
const LONGEST: usize = 2000;

impl Formula {
    /// Reads a text.
    ///
    /// # Errors
    /// What is wrong, and at which character.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        if text.len() > LONGEST {
            return Err(format!("it is longer than {LONGEST} characters"));
        }
        let mut reader = Reader {
            rest: text,
            text,
            operations: Vec::new(),
            names: Vec::new(),
        };
        reader.sum()?;
        if let Some(c) = reader.next() {
            return Err(reader.wrong(&format!("`{c}` is not expected")));
        }
        let formula = Self {
            operations: reader.operations,
            names: reader.names,
        };
        match formula.deepest() > DEPTH {
            true => {
                Err("it is nested too deeply; give a part of it to a state, or write it shorter".to_owned())
            }
            false => Ok(formula),
        }
    }

    /// The variables, in the order of their first appearance.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// The value where `variable` gives that of each variable, by its place among the names.
    pub(super) fn at(&self, variable: impl Fn(usize) -> f64) -> f64 {
        let mut stack = [0.0; DEPTH];
        let mut top = 0;
        for operation in &self.operations {
            match *operation {
                Operation::Number(value) => {
                    stack[top] = value;
                    top += 1;
                }
                Operation::Variable(index) => {
                    stack[top] = variable(index);
                    top += 1;
                }
                Operation::Negate => stack[top - 1] = -stack[top - 1],
                Operation::Whole(power) => stack[top - 1] = stack[top - 1].powi(power),
                Operation::One(function) => stack[top - 1] = function(stack[top - 1]),
                two => {
                    top -= 1;
                    let (a, b) = (stack[top - 1], stack[top]);
                    stack[top - 1] = match two {
                        Operation::Add => a + b,
                        Operation::Subtract => a - b,
                        Operation::Multiply => a * b,
                        Operation::Divide => a / b,
                        Operation::Two(function) => function(a, b),
                        _ => a.powf(b),
                    };
                }
            }
        }
        stack[0]
    }

    fn deepest(&self) -> usize {
        let (mut now, mut most) = (0_usize, 0);
        for operation in &self.operations {
            match operation {
                Operation::Number(_) | Operation::Variable(_) => now += 1,
                Operation::Negate | Operation::Whole(_) | Operation::One(_) => {}
                _ => now -= 1,
            }
            most = most.max(now);
        }
        most
    }
}

/// What is left to read of a formula, and what was read.
struct Reader<'a> {
    text: &'a str,
    rest: &'a str,
    operations: Vec<Operation>,
    names: Vec<String>,
}

impl Reader<'_> {
    fn next(&mut self) -> Option<char> {
        self.rest = self.rest.trim_start();
        self.rest.chars().next()
    }

    fn wrong(&self, problem: &str) -> String {
        let at = self.text[..self.text.len() - self.rest.len()].chars().count() + 1;
        format!("{problem} at character {at}")
    }

    /// Whether this comes next; then it is read.
    fn takes(&mut self, what: &str) -> bool {
        self.next();
        match self.rest.strip_prefix(what) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    fn sum(&mut self) -> Result<(), String> {
        self.product()?;
        loop {
            let operation = if self.takes("+") {
                Operation::Add
            } else if self.takes("-") {
                Operation::Subtract
            } else {
                return Ok(());
            };
            self.product()?;
            self.operations.push(operation);
        }
    }

    fn product(&mut self) -> Result<(), String> {
        self.signed()?;
        loop {
            let operation = if self.is_power() {
                return Ok(());
            } else if self.takes("*") {
                Operation::Multiply
            } else if self.takes("/") {
                Operation::Divide
            } else {
                return Ok(());
            };
            self.signed()?;
            self.operations.push(operation);
        }
    }

    fn signed(&mut self) -> Result<(), String> {
        let mut is_negative = false;
        loop {
            if self.takes("-") {
                is_negative = !is_negative;
            } else if !self.takes("+") {
                break;
            }
        }
        self.power()?;
        if is_negative {
            self.operations.push(Operation::Negate);
        }
        Ok(())
    }

    fn is_power(&mut self) -> bool {
        self.next();
        self.rest.starts_with('^') || self.rest.starts_with("**")
    }

    fn power(&mut self) -> Result<(), String> {
        /// Whole powers that are products.
        const MOST: f64 = 16.0;
        self.atom()?;
        if !self.takes("^") && !self.takes("**") {
            return Ok(());
        }
        let before = self.operations.len();
        self.signed()?;
        match self.operations[before..] {
            [Operation::Number(n)] if n.fract() == 0.0 && n.abs() <= MOST => {
                self.operations.truncate(before);
                self.operations.push(Operation::Whole(n as i32));
            }
            _ => self.operations.push(Operation::Power),
        }
        Ok(())
    }

    fn atom(&mut self) -> Result<(), String> {
        match self.next() {
            None => Err("it ends where a value is expected".to_owned()),
            Some('(') => {
                self.takes("(");
                self.sum()?;
                self.closed()
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() || c == '_' => self.named(),
            Some(c) => Err(self.wrong(&format!("`{c}` is not expected"))),
        }
    }

    fn closed(&mut self) -> Result<(), String> {
        match self.takes(")") {
            true => Ok(()),
            false => Err(self.wrong("`)` is missing")),
        }
    }

    fn number(&mut self) -> Result<(), String> {
        let bytes = self.rest.as_bytes();
        let digits = |mut at: usize| {
            while bytes.get(at).is_some_and(u8::is_ascii_digit) {
                at += 1;
            }
            at
        };
        let mut end = digits(0);
        if bytes.get(end) == Some(&b'.') {
            end = digits(end + 1);
        }
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
            let behind = digits(end + 1 + sign);
            if behind > end + 1 + sign {
                end = behind;
            }
        }
        let value = self.rest[..end].parse();
        let value = value.map_err(|_| self.wrong(&format!("`{}` is no number", &self.rest[..end])))?;
        self.operations.push(Operation::Number(value));
        self.rest = &self.rest[end..];
        Ok(())
    }

    fn named(&mut self) -> Result<(), String> {
        let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let end = self.rest.find(|c| !is_part(c)).unwrap_or(self.rest.len());
        let (name, rest) = self.rest.split_at(end);
        self.rest = rest;
        let one = ONE.iter().find(|(n, _)| *n == name).map(|(_, f)| *f);
        let two = TWO.iter().find(|(n, _)| *n == name).map(|(_, f)| *f);
        if one.is_none() && two.is_none() {
            if self.takes("(") {
                let known: Vec<&str> = ONE.iter().map(|f| f.0).chain(TWO.iter().map(|f| f.0)).collect();
                let meant = MEANT.iter().find(|(n, _)| *n == name);
                let meant = meant.map_or(String::new(), |(_, m)| format!(", write {m}"));
                return Err(format!(
                    "`{name}` is no function{meant}; there are {}",
                    known.join(", ")
                ));
            }
            if PI.contains(&name) {
                self.operations.push(Operation::Number(std::f64::consts::PI));
                return Ok(());
            }
            let index = self.names.iter().position(|n| n == name).unwrap_or_else(|| {
                self.names.push(name.to_owned());
                self.names.len() - 1
            });
            self.operations.push(Operation::Variable(index));
            return Ok(());
        }
        if !self.takes("(") {
            return Err(self.wrong(&format!("`(` is missing behind `{name}`")));
        }
        self.sum()?;
        if let Some(function) = one {
            self.operations.push(Operation::One(function));
        }
        if let Some(function) = two {
            if !self.takes(",") {
                return Err(self.wrong(&format!("`{name}` has two values, with a comma between them")));
            }
            self.sum()?;
            self.operations.push(Operation::Two(function));
        }
        self.closed()
    }
}

#[cfg(test)]
mod tests;
