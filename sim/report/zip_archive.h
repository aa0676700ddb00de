#pragma once

#include <string>
#include <vector>

namespace abbe::sim {

struct ZipEntry {
  std::string name;  ///< ASCII
  std::string bytes;
};

/// Whether zlib's own head and sum stand around deflated bytes, as a browser's DecompressionStream
/// ("deflate") wants, or none, as in a zip archive.
enum class DeflateHead { None, Zlib };

/// @throws std::length_error for 4 GiB or more
std::string deflated(const std::string& bytes, DeflateHead head);

/// A zip archive of these, compressed by deflate, dated 1980-01-01: the same entries give the same
/// bytes.
/// @throws std::length_error for an entry or an archive of 4 GiB or more
/// Source: PKWARE's APPNOTE.TXT, 4.3.
std::string zip_archive(const std::vector<ZipEntry>& entries);

}  // namespace abbe::sim
