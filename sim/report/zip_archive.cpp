#include "sim/report/zip_archive.h"

#include <cstdint>
#include <limits>
#include <stdexcept>

#include <zlib.h>

#include "sim/report/little_endian.h"

namespace abbe::sim {
namespace {

/// A size or a place, which this form of the archive has in 32 bits.
std::uint32_t in_32_bits(std::size_t size) {
  // the highest value stands for "see the 64 bits"
  if (size >= std::numeric_limits<std::uint32_t>::max())
    throw std::length_error("a zip archive without 64-bit sizes ends at 4 GiB");
  return std::uint32_t(size);
}

/// What stands of an entry both before its data and in the directory.
std::string common_head(const ZipEntry& entry, const std::string& packed) {
  constexpr std::uint16_t version = 20, flags = 0, deflate = 8, time = 0, date = 0x21;
  std::string head;
  for (const std::uint16_t word : {version, flags, deflate, time, date}) append(head, word);
  append(head, std::uint32_t(::crc32(0, reinterpret_cast<const Bytef*>(entry.bytes.data()),
                                     uInt(entry.bytes.size()))));
  append(head, in_32_bits(packed.size()));
  append(head, in_32_bits(entry.bytes.size()));
  append(head, std::uint16_t(entry.name.size()));
  append(head, std::uint16_t(0));  // no extra fields
  return head;
}

}  // namespace

std::string deflated(const std::string& bytes, DeflateHead head) {
  z_stream stream{};
  constexpr int window = 15, memory = 8;
  const int bits = head == DeflateHead::Zlib ? window : -window;
  if (::deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, bits, memory,
                     Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::runtime_error("zlib does not start");
  std::string packed(::deflateBound(&stream, in_32_bits(bytes.size())), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = uInt(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = uInt(in_32_bits(packed.size()));
  const int ended = ::deflate(&stream, Z_FINISH);
  packed.resize(stream.total_out);
  ::deflateEnd(&stream);
  if (ended != Z_STREAM_END) throw std::runtime_error("zlib does not finish");
  return packed;
}

std::string zip_archive(const std::vector<ZipEntry>& entries) {
  std::string archive, directory;
  for (const ZipEntry& entry : entries) {
    const std::string packed = deflated(entry.bytes, DeflateHead::None),
                      head = common_head(entry, packed);
    const std::uint32_t at = in_32_bits(archive.size());
    archive.append("PK\x03\x04").append(head).append(entry.name).append(packed);
    directory.append("PK\x01\x02");
    append(directory, std::uint16_t(20));  // made by version 2.0, on no system in particular
    directory += head;
    for (int word = 0; word < 3; ++word)
      append(directory, std::uint16_t(0));  // comment, disk, kind
    append(directory, std::uint32_t(0));    // attributes
    append(directory, at);
    directory += entry.name;
  }
  const std::uint32_t at = in_32_bits(archive.size());
  archive.append(directory).append("PK\x05\x06");
  for (int word = 0; word < 2; ++word) append(archive, std::uint16_t(0));  // disks
  for (int word = 0; word < 2; ++word) append(archive, std::uint16_t(entries.size()));
  append(archive, in_32_bits(directory.size()));
  append(archive, at);
  append(archive, std::uint16_t(0));  // no comment
  return archive;
}

}  // namespace abbe::sim
