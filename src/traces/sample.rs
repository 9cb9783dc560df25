//! One value of a trace or of the program, in a form that both have.

use std::sync::Arc;

use khz_bytecode::container::ElementaryType;
use khz_bytecode::value::Storage;
use khz_machine::image::Image;
use khz_machine::semantics::{Value, canonical_f32, canonical_f64};
use khz_machine::variables::{Domain, Variable, VariableError, VariableTable, VariableValue, integer_range};

/// A value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sample {
    /// None yet.
    Nothing,
    /// BOOL (0, 1), an integer or bit string, nanoseconds of a time.
    Whole(i64),
    /// A number of 64 bits beyond those.
    Wide(u64),
    /// REAL, LREAL, and numbers with a fraction.
    Real(f64),
    /// A text or the name of an enumeration's value: position in [`Texts`].
    Text(u32),
}

impl Sample {
    /// As a number for curves and tolerances; none for texts.
    #[must_use]
    pub fn number(self) -> Option<f64> {
        match self {
            Sample::Whole(value) => Some(value as f64),
            Sample::Wide(value) => Some(value as f64),
            Sample::Real(value) => Some(value),
            Sample::Nothing | Sample::Text(_) => None,
        }
    }

    fn whole(self) -> Option<i128> {
        match self {
            Sample::Whole(value) => Some(i128::from(value)),
            Sample::Wide(value) => Some(i128::from(value)),
            _ => None,
        }
    }

    fn of_unsigned(value: u64) -> Sample {
        i64::try_from(value).map_or(Sample::Wide(value), Sample::Whole)
    }

    /// How far two values lie apart: 0 when they are equal, also for two NaN; infinite when they can not be compared.
    #[must_use]
    pub fn deviation(self, other: Sample) -> f64 {
        if let (Some(a), Some(b)) = (self.whole(), other.whole()) {
            return a.abs_diff(b) as f64;
        }
        match (self.number(), other.number()) {
            (Some(a), Some(b)) if a == b || (a.is_nan() && b.is_nan()) => 0.0,
            (Some(a), Some(b)) if a.is_finite() && b.is_finite() => (a - b).abs(),
            (None, None) if self == other => 0.0,
            _ => f64::INFINITY,
        }
    }
}

/// Texts of the program, beside those of the trace: further ones are not kept.
const MAX_TEXTS: usize = 100_000;

/// Texts, each once.
#[derive(Debug, Clone, Default)]
pub struct Texts {
    list: Vec<Arc<str>>,
    positions: std::collections::BTreeMap<Arc<str>, u32>,
    /// How many of them [`Texts::add_limited`] added.
    limited: usize,
}

impl Texts {
    /// The sample of a text; it is added when it is new.
    pub fn add(&mut self, text: &str) -> Sample {
        if let Some(found) = self.find(text) {
            return found;
        }
        let position = u32::try_from(self.list.len()).unwrap_or(u32::MAX);
        let text: Arc<str> = text.into();
        self.list.push(text.clone());
        self.positions.insert(text, position);
        Sample::Text(position)
    }

    /// The sample of a text that is known.
    fn find(&self, text: &str) -> Option<Sample> {
        self.positions.get(text).map(|position| Sample::Text(*position))
    }

    /// The sample of a text of the program, which makes as many as it likes: beyond a limit those that are new are all the same, and like none of the trace's.
    fn add_limited(&mut self, text: &str) -> Sample {
        match self.find(text) {
            Some(found) => found,
            None if self.limited >= MAX_TEXTS => Sample::Text(u32::MAX),
            None => {
                self.limited += 1;
                self.add(text)
            }
        }
    }

    /// A text.
    #[must_use]
    pub fn get(&self, position: u32) -> &str {
        self.list.get(position as usize).map_or("", AsRef::as_ref)
    }
}

/// A variable's value in an image.
pub fn sample(names: &VariableTable, texts: &mut Texts, image: &Image, variable: &Variable) -> Sample {
    match names.read(image, variable) {
        Ok(VariableValue::Bool(value)) => Sample::Whole(i64::from(value)),
        Ok(VariableValue::Signed(value) | VariableValue::Time(_, value)) => Sample::Whole(value),
        Ok(VariableValue::Unsigned(value)) => Sample::of_unsigned(value),
        Ok(VariableValue::Real(value)) => Sample::Real(f64::from(value)),
        Ok(VariableValue::Lreal(value)) => Sample::Real(value),
        Ok(VariableValue::String(_) | VariableValue::WideString(_) | VariableValue::Named(_)) => {
            texts.add_limited(&names.text(image, variable))
        }
        Err(_) => Sample::Nothing,
    }
}

/// Writes an IEC literal to `scratch`, and gives it as a value.
///
/// # Errors
/// Those of [`VariableTable::write`].
pub fn literal(
    names: &VariableTable,
    texts: &mut Texts,
    scratch: &mut Image,
    (variable, domain): (&Variable, &Domain),
    literal: &str,
) -> Result<Sample, VariableError> {
    names.write(scratch, variable, literal)?;
    Ok(match is_text(domain) {
        true => texts.add(&names.text(scratch, variable)),
        false => sample(names, texts, scratch, variable),
    })
}

/// Gives a variable a value that was checked when it was read: no literal is read again but that of a text.
pub fn write(
    names: &VariableTable,
    texts: &Texts,
    image: &mut Image,
    (variable, domain): (&Variable, &Domain),
    value: Sample,
) {
    let bits = match (value, domain) {
        (Sample::Nothing, _) => return,
        (Sample::Text(text), _) => {
            // The literal was written to a copy of this image before.
            let _ = names.write(image, variable, texts.get(text));
            return;
        }
        (Sample::Whole(value), _) => value as u64,
        (Sample::Wide(value), _) => value,
        (Sample::Real(value), Domain::Elementary(ElementaryType::Real)) => {
            u64::from(canonical_f32(value as f32).to_bits())
        }
        (Sample::Real(value), _) => canonical_f64(value).to_bits(),
    };
    names.write_bits(image, variable, bits);
}

/// How a cell of a variable is read.
#[derive(Debug, Clone)]
pub struct Reader {
    /// The variable.
    pub variable: Variable,
    /// What it can hold.
    pub domain: Domain,
    /// The cell times this, plus that, is the variable's value.
    pub scale: Option<(f64, f64)>,
    /// It drives the program: only values that the variable can hold.
    pub strict: bool,
}

impl Reader {
    /// Reads a cell that is not empty. `scratch` is written to.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn read(
        &self,
        names: &VariableTable,
        texts: &mut Texts,
        scratch: &mut Image,
        cell: &str,
    ) -> Result<Sample, String> {
        if let Some((factor, offset)) = self.scale {
            let number = plain(cell).ok_or_else(|| format!("`{cell}` is not a number"))?;
            return self.fitted(number * factor + offset);
        }
        if let Some(sample) = self.quick(cell) {
            return Ok(sample);
        }
        if let Domain::Text { .. } = self.domain
            && !cell.starts_with(['\'', '"'])
        {
            let units: Vec<u16> = cell.encode_utf16().collect();
            names.write_units(scratch, &self.variable, &units);
            return Ok(texts.add(&names.text(scratch, &self.variable)));
        }
        literal(names, texts, scratch, (&self.variable, &self.domain), cell).or_else(|error| {
            let number = plain(cell).filter(|_| !self.strict && !is_text(&self.domain));
            number.map(Sample::Real).ok_or_else(|| error.to_string())
        })
    }

    /// Plain decimal numbers of types that hold them all; the rest goes the long way.
    fn quick(&self, cell: &str) -> Option<Sample> {
        use ElementaryType as E;
        match &self.domain {
            Domain::Elementary(E::Bool) => match cell {
                "0" => Some(Sample::Whole(0)),
                "1" => Some(Sample::Whole(1)),
                _ => None,
            },
            // A REAL is rounded once, from its text.
            Domain::Elementary(E::Real) => {
                cell.parse().ok().filter(|v: &f32| v.is_finite()).map(|v| Sample::Real(f64::from(v)))
            }
            Domain::Elementary(E::Lreal) => cell.parse().ok().filter(|v: &f64| v.is_finite()).map(Sample::Real),
            Domain::Elementary(E::Lint | E::Dint) if !self.strict => cell.parse().ok().map(Sample::Whole),
            Domain::Elementary(E::Time | E::Ltime) => cell.parse().ok().map(Sample::Whole),
            _ => None,
        }
    }

    /// A computed number as a value of the variable.
    fn fitted(&self, number: f64) -> Result<Sample, String> {
        match &self.domain {
            Domain::Elementary(ElementaryType::Real) => Ok(Sample::Real(f64::from(number as f32))),
            Domain::Elementary(ElementaryType::Lreal) => Ok(Sample::Real(number)),
            Domain::Text { .. } | Domain::Values { .. } => Err("a text can not be scaled".to_string()),
            _ if !self.strict => Ok(Sample::Real(number)),
            Domain::Elementary(ElementaryType::Bool) => Ok(Sample::Whole(i64::from(number != 0.0))),
            Domain::Elementary(base) | Domain::Subrange { base, .. } => {
                let (least, most) = range(*base, &self.domain);
                let rounded = number.round();
                if !(least as f64..=most as f64).contains(&rounded) {
                    return Err(format!("{number} is outside {least} to {most}"));
                }
                // It is a whole number in the range, whose ends may not be exact as an f64.
                Ok(Sample::of_whole((rounded as i128).clamp(least, most)))
            }
        }
    }
}

impl Sample {
    fn of_whole(value: i128) -> Sample {
        i64::try_from(value).map_or(Sample::Wide(value as u64), Sample::Whole)
    }
}

/// Least and greatest value of an integer type or a part of one; times and dates are 64 bits of nanoseconds.
fn range(base: ElementaryType, domain: &Domain) -> (i128, i128) {
    let whole = integer_range(base).unwrap_or((i128::from(i64::MIN), i128::from(i64::MAX)));
    match domain {
        Domain::Subrange { lower, upper, .. } if whole.0 == 0 => (i128::from(*lower as u64), i128::from(*upper as u64)),
        Domain::Subrange { lower, upper, .. } => (i128::from(*lower), i128::from(*upper)),
        _ => whole,
    }
}

/// A number as other programs write it; TRUE and FALSE are 1 and 0.
fn plain(cell: &str) -> Option<f64> {
    match cell {
        _ if cell.eq_ignore_ascii_case("TRUE") => Some(1.0),
        _ if cell.eq_ignore_ascii_case("FALSE") => Some(0.0),
        _ => cell.parse().ok(),
    }
}

/// A sample in words.
#[must_use]
pub fn text(sample: Sample, texts: &Texts, domain: &Domain) -> String {
    match (sample, domain) {
        (Sample::Nothing, _) => "nothing".to_string(),
        (Sample::Whole(value), Domain::Elementary(ElementaryType::Bool)) => {
            if value == 0 { "FALSE" } else { "TRUE" }.to_string()
        }
        (Sample::Whole(value), Domain::Elementary(ty)) if is_moment(*ty) => {
            let mut out = String::new();
            VariableValue::from_loaded(*ty, Value::I64(value)).write_text(&mut out);
            out
        }
        (Sample::Whole(value), _) => value.to_string(),
        (Sample::Wide(value), _) => value.to_string(),
        (Sample::Real(value), Domain::Elementary(ElementaryType::Real)) => format!("{}", value as f32),
        (Sample::Real(value), _) => format!("{value}"),
        (Sample::Text(u32::MAX), _) => "another text".to_string(),
        (Sample::Text(position), _) => texts.get(position).to_string(),
    }
}

/// A deviation or tolerance in words: that of a time or date is a duration.
#[must_use]
pub fn deviation_text(deviation: f64, domain: &Domain) -> String {
    if !is_time(domain) {
        return format!("{deviation}");
    }
    let mut out = String::new();
    // Beyond 292 years the greatest duration is named.
    VariableValue::from_loaded(ElementaryType::Time, Value::I64(deviation.round() as i64)).write_text(&mut out);
    out
}

/// Whether values are numbers or times, for which a tolerance can count.
#[must_use]
pub fn is_number(domain: &Domain) -> bool {
    !is_text(domain) && !matches!(domain, Domain::Elementary(ElementaryType::Bool))
}

/// Whether values are times or dates.
#[must_use]
pub fn is_time(domain: &Domain) -> bool {
    matches!(domain, Domain::Elementary(ty) if is_moment(*ty))
}

/// Whether values are texts or names.
fn is_text(domain: &Domain) -> bool {
    use ElementaryType as E;
    matches!(domain, Domain::Text { .. } | Domain::Values { .. } | Domain::Elementary(E::Char | E::Wchar))
}

/// A time or a date.
fn is_moment(ty: ElementaryType) -> bool {
    use ElementaryType as E;
    ty.storage() == Storage::I64 && !matches!(ty, E::Lint | E::Ulint | E::Lword)
}
