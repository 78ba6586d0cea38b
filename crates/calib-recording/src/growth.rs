//! Vectors that grow with a file and stay little larger than what is in them.

/// Appends; a full vector gets an eighth more room, not twice as much, so that what a file is read into is never much
/// larger than its samples. Large vectors grow in place where the system can do that.
#[inline]
pub(crate) fn push<T>(vector: &mut Vec<T>, value: T) {
    if vector.len() == vector.capacity() {
        make_room(vector);
    }
    vector.push(value);
}

#[cold]
fn make_room<T>(vector: &mut Vec<T>) {
    vector.reserve_exact((vector.len() / 8).max(16));
}
