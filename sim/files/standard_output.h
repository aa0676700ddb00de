#pragma once

namespace abbe::sim {

/// Lets every write that cannot succeed fail with an error: a standard stream that the shell closed
/// is held by /dev/null, so that no file opened later takes its number, and the limit on the size
/// of files (`ulimit -f`) raises no signal.
void make_writes_fail();

/// Hands over what standard output still holds. @throws OutputFailure if any of it was lost
void flush_output();

}  // namespace abbe::sim
