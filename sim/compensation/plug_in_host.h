#pragma once

/// How the asking side starts a host of a shared library (plug_in_host in plug_in.h).
namespace abbe::sim::compensation {

inline constexpr const char* host_word = "plug-in-host";       ///< its first argument
inline constexpr const char* host_mark = "ABBE_PLUG_IN_HOST";  ///< set in its environment

}  // namespace abbe::sim::compensation
