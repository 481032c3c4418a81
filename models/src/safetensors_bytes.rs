//! Safetensors files with reproducible bytes.

use std::collections::{BTreeMap, HashMap};

use safetensors::SafeTensorError;
use safetensors::tensor::View;
use serde_json::Value;

/// Number of bytes of the length field in front of the header.
const LENGTH: usize = size_of::<u64>();
/// Alignment of the first tensor in bytes.
const ALIGNMENT: usize = 8;

/// Returns the bytes of a file with `metadata`; equal content gives equal bytes.
///
/// `safetensors::serialize` alone writes metadata in an order that changes from call to call.
///
/// # Errors
/// Shapes that do not match their values.
pub fn safetensors_bytes<S, V>(
    tensors: impl IntoIterator<Item = (S, V)>,
    metadata: impl IntoIterator<Item = (String, String)>,
) -> Result<Vec<u8>, SafeTensorError>
where
    S: AsRef<str> + Ord + std::fmt::Display,
    V: View,
{
    let metadata: HashMap<String, String> = metadata.into_iter().collect();
    let bytes = safetensors::serialize(tensors, Some(metadata))?;
    Ok(in_order(&bytes).unwrap_or(bytes))
}

/// Returns the file with the names in its header in alphabetical order; `None` if `bytes` is not such a file.
fn in_order(bytes: &[u8]) -> Option<Vec<u8>> {
    let (length, rest) = bytes.split_first_chunk::<LENGTH>()?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
    let (header, tensors) = rest.split_at_checked(length)?;
    let mut header: BTreeMap<String, Value> = serde_json::from_slice(header).ok()?;
    if let Some(Value::Object(metadata)) = header.get_mut("__metadata__") {
        let sorted: BTreeMap<String, Value> = std::mem::take(metadata).into_iter().collect();
        metadata.extend(sorted);
    }
    let mut ordered = serde_json::to_vec(&header).ok()?;
    ordered.resize(ordered.len().next_multiple_of(ALIGNMENT), b' ');
    let mut file = (ordered.len() as u64).to_le_bytes().to_vec();
    file.extend(ordered);
    file.extend_from_slice(tensors);
    Some(file)
}

#[cfg(test)]
mod tests {
    use safetensors::SafeTensors;
    use safetensors::tensor::{Dtype, TensorView};

    use super::*;

    #[test]
    fn equal_content_gives_equal_bytes_that_hold_it() {
        let values: Vec<u8> = (0..24).collect();
        let file = || {
            let view = |count: usize| {
                TensorView::new(Dtype::F32, vec![count], &values[..4 * count]).unwrap()
            };
            let metadata = (0..12).map(|i| (format!("key {}", i * 7 % 12), format!("{i}\n\"é\"")));
            safetensors_bytes([("b", view(6)), ("a", view(1))], metadata).unwrap()
        };
        let first = file();
        for _ in 0..20 {
            assert!(first == file());
        }
        let read = SafeTensors::deserialize(&first).unwrap();
        assert_eq!(read.tensor("b").unwrap().data(), values);
        assert_eq!(read.tensor("a").unwrap().data(), &values[..4]);
        let (_, header) = SafeTensors::read_metadata(&first).unwrap();
        let metadata = header.metadata().as_ref().unwrap();
        assert_eq!(metadata.len(), 12);
        assert_eq!(metadata["key 7"], "1\n\"é\"");
    }
}
