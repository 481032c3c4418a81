//! Weights, and spectra of weights that are kept as long as the weights stay the same.

use std::any::Any;
use std::borrow::Cow;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use super::trim::Trim;

/// Identifies the memory that weights lie in.
///
/// Two equal identities must mean equal weights. With an [`Arc`] that is changed only through [`Arc::make_mut`] they do: where [`Weak`]
/// pointers exist it moves the values first, and no other allocation takes the old address while one is left.
pub type Identity = Weak<dyn Any + Send + Sync>;

/// The weights of one call, `[maps_out, maps_in, kernel steps, kernel taxels]`.
///
/// With an identity, their spectra are kept for the next call: the two passes of an adversarial step share them, and predictions
/// with frozen weights compute them once.
#[derive(Clone)]
pub struct Weight<'a> {
    values: &'a [f32],
    trim: Option<Trim>,
    identity: Option<Identity>,
}

impl<'a> Weight<'a> {
    /// Returns weights with an identity.
    ///
    /// - `values`: `[maps_out, maps_in, kernel steps, kernel taxels]`
    pub fn known(values: &'a [f32], identity: Identity) -> Self {
        Self {
            values,
            trim: None,
            identity: Some(identity),
        }
    }

    /// Returns the same weights, of whose taps only those of `trim` are wanted.
    pub(super) fn of_taps(self, trim: Option<Trim>) -> Self {
        Self { trim, ..self }
    }

    /// Returns the wanted taps, `[maps_out, maps_in, kernel steps, kernel taxels]`.
    pub(super) fn values(&self) -> Cow<'a, [f32]> {
        match &self.trim {
            Some(trim) => Cow::Owned(trim.trimmed(self.values)),
            None => Cow::Borrowed(self.values),
        }
    }

    /// Number of all taps.
    pub(super) fn len(&self) -> usize {
        self.values.len()
    }
}

impl<'a> From<&'a [f32]> for Weight<'a> {
    fn from(values: &'a [f32]) -> Self {
        Self {
            values,
            trim: None,
            identity: None,
        }
    }
}

impl<'a> From<&'a Vec<f32>> for Weight<'a> {
    fn from(values: &'a Vec<f32>) -> Self {
        Self::from(values.as_slice())
    }
}

/// Cache of the value computed from the last weights that had an identity.
pub(super) struct Remembered<T>(Mutex<Option<(Identity, Arc<T>)>>);

impl<T> Default for Remembered<T> {
    fn default() -> Self {
        Self(Mutex::new(None))
    }
}

impl<T> fmt::Debug for Remembered<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Remembered")
    }
}

impl<T> Remembered<T> {
    /// Returns the value for these weights, computed by `make` if they are new. `make` gets the previous value, unless it is in use.
    pub(super) fn get_or_make(
        &self,
        weight: &Weight<'_>,
        make: impl FnOnce(Option<T>) -> T,
    ) -> Arc<T> {
        let Some(identity) = &weight.identity else {
            return Arc::new(make(None));
        };
        let before = {
            let mut last = self.last();
            match &*last {
                Some((known, made)) if Weak::ptr_eq(known, identity) => return Arc::clone(made),
                _ => last.take().and_then(|(_, made)| Arc::into_inner(made)),
            }
        };
        // Not locked meanwhile: a thread of the pool that waits within `make` may run another task that locks this.
        let made = Arc::new(make(before));
        *self.last() = Some((Weak::clone(identity), Arc::clone(&made)));
        made
    }

    fn last(&self) -> MutexGuard<'_, Option<(Identity, Arc<T>)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_memory_is_used_once_and_other_memory_anew() {
        let remembered = Remembered::default();
        let count = Mutex::new(0);
        let make = |_: Option<i32>| {
            *count.lock().unwrap() += 1;
            *count.lock().unwrap()
        };
        let values = [1.0, 2.0];
        let (mut first, second) = (Arc::new(1), Arc::new(1));
        let known = |memory: &Arc<i32>| {
            let identity: Weak<i32> = Arc::downgrade(memory);
            Weight::known(&values, identity)
        };
        assert_eq!(*remembered.get_or_make(&known(&first), make), 1);
        assert_eq!(*remembered.get_or_make(&known(&first), make), 1);
        assert_eq!(*remembered.get_or_make(&known(&second), make), 2);
        assert_eq!(*remembered.get_or_make(&known(&first), make), 3);
        let nameless = Weight::from(&values[..]);
        assert_eq!(*remembered.get_or_make(&nameless, make), 4);
        assert_eq!(*remembered.get_or_make(&known(&first), make), 3);
        // Changed by the only one who holds it.
        *Arc::make_mut(&mut first) += 1;
        assert_eq!(*remembered.get_or_make(&known(&first), make), 5);
    }
}
