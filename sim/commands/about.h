#pragma once

namespace abbe::sim {

/// What abbe is, on one line and in a paragraph, and what its exit codes mean: for `--help`, for
/// the pages of the manual and for `abbe help`.
inline constexpr const char* about_line = "virtual five-axis machine tool that is wrong on purpose";
inline constexpr const char* about_text =
    "It cuts a part on a machine with errors and shows, in micrometres on the design surface, "
    "what they\ndid, with and without a compensator.";
inline constexpr const char* exit_codes_text =
    "0 ok, 1 an acceptance limit of the scene was exceeded, 2 usage, 3 input,\n"
    "4 numerical, 5 output, 6 plug-in, 130 interrupted.";

}  // namespace abbe::sim
