//! Weights, and cached results that stay valid while the weights do not change.

use std::any::Any;
use std::borrow::Cow;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use super::trim::Trim;

/// Identity of the memory that holds weights.
///
/// Equal identities must mean equal weights. An [`Arc`] that is only modified through [`Arc::make_mut`] guarantees this: if [`Weak`]
/// pointers exist, it moves the values first, and no other allocation reuses the old address while a pointer is left.
pub type Identity = Weak<dyn Any + Send + Sync>;

/// Weights of one call, `[maps_out, maps_in, kernel steps, kernel taxels]`.
///
/// With an identity their spectra are cached for the next call. So the two passes of an adversarial step share them, and predictions
/// with fixed weights compute them once.
#[derive(Clone)]
pub struct Weight<'a> {
    values: &'a [f32],
    trim: Option<Trim>,
    identity: Option<Identity>,
}

impl<'a> Weight<'a> {
    /// Creates weights with an identity.
    ///
    /// - `values`: `[maps_out, maps_in, kernel steps, kernel taxels]`
    pub fn known(values: &'a [f32], identity: Identity) -> Self {
        Self {
            values,
            trim: None,
            identity: Some(identity),
        }
    }

    /// Restricts the weights to the taps of `trim`.
    pub(super) fn of_taps(self, trim: Option<Trim>) -> Self {
        Self { trim, ..self }
    }

    /// Returns the selected taps, `[maps_out, maps_in, kernel steps, kernel taxels]`.
    pub(super) fn values(&self) -> Cow<'a, [f32]> {
        match &self.trim {
            Some(trim) => Cow::Owned(trim.trimmed(self.values)),
            None => Cow::Borrowed(self.values),
        }
    }

    /// Returns the number of all taps.
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

/// Cache of the value that was computed from the latest weights with an identity.
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
    /// Returns the value for these weights; if they are new, `make` computes it from the previous value, unless that is in use.
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
        // The lock is released meanwhile: while `make` waits, this pool thread may run another task that needs the lock.
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
        // The only owner changes the value.
        *Arc::make_mut(&mut first) += 1;
        assert_eq!(*remembered.get_or_make(&known(&first), make), 5);
    }
}
