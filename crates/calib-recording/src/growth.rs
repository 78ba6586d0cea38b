//! Vectors that grow with a file and stay little larger than what is in them.

/// Up to this size a vector doubles as usual: copying small blocks often costs more than they take.
const SMALL: usize = 64 << 10;

/// Appends; a full vector of some size gets a quarter more room, not twice as much, so that what a file is read into is
/// never much larger than its samples. Large vectors grow in place where the system can do that.
#[inline]
pub(crate) fn push<T>(vector: &mut Vec<T>, value: T) {
    if vector.len() == vector.capacity() {
        make_room(vector);
    }
    vector.push(value);
}

#[cold]
fn make_room<T>(vector: &mut Vec<T>) {
    let length = vector.len();
    let small = length * size_of::<T>() < SMALL;
    vector.reserve_exact(if small { length.max(16) } else { length / 4 });
}
