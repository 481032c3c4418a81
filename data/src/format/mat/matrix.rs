//! Arrays of MATLAB files of version 5. Their values are decoded only when they are asked for.

use super::super::hdf5_values::rows_of;
use super::super::npy::Array;
use super::element::{Element, Elements, MATRIX};
use hdf5_reader::ByteOrder;

/// Maximum number of dimensions.
const MOST_DIMENSIONS: usize = 32;
/// Maximum number of fields of a struct.
const MOST_FIELDS: usize = 10_000;
/// Maximum length of a field's name, in bytes; MATLAB has 63.
const LONGEST_NAME: usize = 1024;

const CELL: u8 = 1;
const STRUCT: u8 = 2;
const CHAR: u8 = 4;
const SPARSE: u8 = 5;
const OPAQUE: u8 = 17;
/// Names of MATLAB's classes by their number.
const CLASSES: [&str; 18] = [
    "", "cell", "struct", "object", "char", "sparse", "double", "single", "int8", "uint8", "int16",
    "uint16", "int32", "uint32", "int64", "uint64", "function", "object",
];

/// Array of MATLAB.
#[derive(Debug, Clone)]
pub(super) struct Matrix<'a> {
    pub(super) name: String,
    /// Extents in the order of the indices.
    pub(super) shape: Vec<usize>,
    class: u8,
    is_complex: bool,
    is_logical: bool,
    /// Name of the class of an object that only MATLAB can read.
    object: Option<String>,
    /// Elements behind the name.
    content: Elements<'a>,
}

impl<'a> Matrix<'a> {
    /// Reads the header of the array in an element of type [`MATRIX`].
    ///
    /// # Errors
    /// A sentence about damage.
    pub(super) fn of(mut elements: Elements<'a>) -> Result<Self, String> {
        let flags = elements.next()?;
        let word = flags
            .data
            .first_chunk::<4>()
            .ok_or("an array without flags")?;
        let word = super::element::number(*word, elements.order());
        let mut matrix = Self {
            name: String::new(),
            shape: Vec::new(),
            class: (word & 0xff) as u8,
            is_complex: word & 0x800 != 0,
            is_logical: word & 0x200 != 0,
            object: None,
            content: elements,
        };
        if matrix.class == OPAQUE {
            let mut texts = [String::new(), String::new(), String::new()];
            for text in &mut texts {
                *text = text_of(elements.next()?);
            }
            let [name, _, class] = texts;
            matrix.name = name;
            matrix.object = Some(class);
            return Ok(matrix);
        }
        let extents = elements.next()?;
        let (extents, _) = extents.data.as_chunks::<4>();
        if extents.len() > MOST_DIMENSIONS {
            return Err(format!("an array of {} dimensions", extents.len()));
        }
        let order = elements.order();
        let extent = |bytes: &[u8; 4]| super::element::number(*bytes, order) as usize;
        matrix.shape = extents.iter().map(extent).collect();
        matrix.name = text_of(elements.next()?);
        matrix.content = elements;
        Ok(matrix)
    }

    /// Returns class, shape and name without the values.
    pub(super) fn head(self) -> Matrix<'static> {
        Matrix {
            content: Elements::new(&[], self.content.order()),
            ..self
        }
    }

    /// Returns MATLAB's name of the class.
    pub(super) fn class(&self) -> String {
        match &self.object {
            Some(class) => class.clone(),
            None if self.is_logical => "logical".into(),
            None => {
                let name = CLASSES.get(usize::from(self.class)).copied();
                name.unwrap_or("an unknown class").into()
            }
        }
    }

    /// Returns true for a struct that is not an array of structs.
    pub(super) fn is_struct(&self) -> bool {
        self.class == STRUCT && self.shape.iter().all(|extent| *extent == 1)
    }

    /// Returns the number of values.
    fn count(&self) -> Result<usize, String> {
        let count = self
            .shape
            .iter()
            .try_fold(1_usize, |n, &extent| n.checked_mul(extent));
        count.ok_or_else(|| format!("{:?} values", self.shape))
    }

    /// Returns the values: numbers, or text.
    ///
    /// # Errors
    /// A sentence about values that are neither, or damaged.
    pub(super) fn array(&self) -> Result<Array, String> {
        if self.object.is_none() && self.shape.contains(&0) {
            return Err("no values".into());
        }
        match self.class {
            CHAR => {
                let rows = self.rows()?;
                Ok(Array::of_texts(vec![rows.len()], rows))
            }
            CELL => Ok(Array::of_texts(self.shape.clone(), self.cells()?)),
            SPARSE => Err("a sparse array; `X = full(X)` makes a usual one".into()),
            6..=15 => self.numbers().map(Array::with_columns_first),
            _ => Err(match self.class().as_str() {
                class @ ("string" | "categorical") => format!(
                    "a {class} array, which only MATLAB can read; `y = cellstr(y)` makes text of it"
                ),
                class => format!("an array of class {class}"),
            }),
        }
    }

    /// Returns the numbers as they are stored: MATLAB stores whole numbers in the smallest type.
    fn numbers(&self) -> Result<Array, String> {
        if self.is_complex {
            return Err("complex numbers; `abs(X)` or `real(X)` gives real ones".into());
        }
        let mut content = self.content;
        let Element { kind, data } = content.next()?;
        let (kind, size) = match kind {
            1 => ('i', 1),
            2 => ('u', 1),
            3 => ('i', 2),
            4 => ('u', 2),
            5 => ('i', 4),
            6 => ('u', 4),
            7 => ('f', 4),
            9 => ('f', 8),
            12 => ('i', 8),
            13 => ('u', 8),
            other => return Err(format!("numbers of the unknown type {other}")),
        };
        if self.count()?.checked_mul(size) != Some(data.len()) {
            return Err(format!("{} bytes for {:?} values", data.len(), self.shape));
        }
        let shape = self.shape.clone();
        Ok(Array::of_bytes(
            kind,
            size,
            content.order(),
            shape,
            data.to_vec(),
        ))
    }

    /// Returns the rows of a char matrix, without blanks at their ends.
    fn rows(&self) -> Result<Vec<String>, String> {
        let mut content = self.content;
        let Element { kind, data } = content.next()?;
        let damaged = || {
            format!(
                "{} bytes of text for {:?} characters",
                data.len(),
                self.shape
            )
        };
        let rows = self.shape.first().copied().unwrap_or(1);
        let units: Vec<u16> = match kind {
            1 | 2 => data.iter().copied().map(u16::from).collect(),
            16 => str::from_utf8(data)
                .map_err(|_| damaged())?
                .encode_utf16()
                .collect(),
            4 | 17 => {
                let (units, _) = data.as_chunks();
                let unit = |bytes: &[u8; 2]| match content.order() {
                    ByteOrder::LittleEndian => u16::from_le_bytes(*bytes),
                    ByteOrder::BigEndian => u16::from_be_bytes(*bytes),
                };
                units.iter().map(unit).collect()
            }
            other => return Err(format!("text of the unknown type {other}")),
        };
        // A single row of UTF-8 may count other units.
        if units.len() != self.count()? && (rows != 1 || kind != 16) {
            return Err(damaged());
        }
        Ok(rows_of(&units, rows))
    }

    /// Returns text or single whole numbers of all cells.
    fn cells(&self) -> Result<Vec<String>, String> {
        let mut content = self.content;
        let mut texts = Vec::new();
        while !content.is_empty() {
            let number = texts.len() + 1;
            let inner = inner(&mut content)?;
            let text = inner
                .cell()
                .map_err(|found| format!("cell {number} with {found}"))?;
            texts.push(text);
        }
        if texts.len() != self.count()? {
            return Err(format!("{} cells for {:?}", texts.len(), self.shape));
        }
        Ok(texts)
    }

    /// Returns the text or number of one cell.
    fn cell(&self) -> Result<String, String> {
        match self.class {
            CHAR if self.shape.contains(&0) => Ok(String::new()),
            CHAR => match self.rows()?.as_slice() {
                [text] => Ok(text.clone()),
                rows => Err(format!("{} lines of text", rows.len())),
            },
            6..=15 => {
                let text = self.numbers()?.single_text();
                text.ok_or_else(|| format!("{:?} numbers", self.shape))
            }
            _ => Err(format!("a {}", self.class())),
        }
    }

    /// Returns the fields of a struct.
    ///
    /// # Errors
    /// A sentence about damage.
    pub(super) fn fields(&self) -> Result<Vec<Matrix<'a>>, String> {
        let mut content = self.content;
        let length = content.next()?;
        let length = length
            .data
            .first_chunk::<4>()
            .map(|b| super::element::number(*b, content.order()));
        let length = length.unwrap_or(0) as usize;
        let names = content.next()?.data;
        if length == 0 || length > LONGEST_NAME {
            return Err(format!("fields with names of {length} bytes"));
        }
        if names.len() / length > MOST_FIELDS {
            return Err(format!("a struct of {} fields", names.len() / length));
        }
        let mut fields = Vec::new();
        for data in names.chunks_exact(length) {
            let mut field = inner(&mut content)?;
            field.name = text_of(Element { kind: 1, data });
            fields.push(field);
        }
        Ok(fields)
    }
}

/// Removes the next element, an array without a name.
fn inner<'a>(content: &mut Elements<'a>) -> Result<Matrix<'a>, String> {
    let element = content.next()?;
    if element.kind != MATRIX {
        return Err("an element that is no array".into());
    }
    // MATLAB stores an empty array as nothing.
    if element.data.is_empty() {
        let content = Elements::new(element.data, content.order());
        return Ok(Matrix {
            name: String::new(),
            shape: vec![0, 0],
            class: CHAR,
            is_complex: false,
            is_logical: false,
            object: None,
            content,
        });
    }
    Matrix::of(Elements::new(element.data, content.order()))
}

/// Returns a name of ASCII or UTF-8.
fn text_of(element: Element<'_>) -> String {
    let end = element.data.iter().position(|byte| *byte == 0);
    let name = &element.data[..end.unwrap_or(element.data.len())];
    String::from_utf8_lossy(name).into_owned()
}
