#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "sim/report/page_data.h"

namespace abbe::sim {

/// Return files of render/report as they were when the program was built.
std::string_view viewer_page();
std::string_view viewer_style();
std::string_view charts_page();
std::string_view charts_style();

/// Return the scripts of a page, words.js first.
std::string viewer_script();
std::string charts_script();

/// A label or sentence of a report in both languages.
struct ReportLabel {
  std::string_view key;  ///< name in the page and its script
  std::string_view en, zh;
};

/// Returns all labels of a report.
std::span<const ReportLabel> report_labels();

/// Returns all labels of a page of tables and charts besides those of report_labels(); no key is in
/// both.
std::span<const ReportLabel> chart_labels();

}  // namespace abbe::sim

namespace abbe::sim::html {

// Text for HTML pages.

/// Returns a text with the special characters of HTML escaped.
std::string html_escaped(std::string_view text);

/// Returns JSON that can stand inside a script element.
std::string in_script(const nlohmann::ordered_json& json);

/// Returns an element that the script of the page fills with the label in the displayed language.
std::string label(const char* key, const char* element = "span");

/// Returns a term and its description for a <dl>.
std::string row(const char* key, const std::string& value);

/// Returns lines as a <ul>, or a text that there are none.
std::string list(const std::vector<std::string>& lines);

/// Returns {"key": {"en": ..., "zh": ...}}.
nlohmann::ordered_json labels_json(std::span<const ReportLabel> labels);

/// Returns a page with the text of its labels in one language, "en" or "zh", which a browser
/// without scripts shows.
/// @throws std::out_of_range if a label is unknown
std::string insert_labels(std::string_view page, std::span<const ReportLabel> labels,
                          const std::string& language);

/// Returns the page with the values in place of {{name}}; inserted text is not searched again.
/// @throws std::out_of_range if a name has no value
std::string filled(std::string_view page, const std::map<std::string, std::string>& values);

}  // namespace abbe::sim::html

namespace abbe::sim {

// Hash of the script that may run in a page; the page forbids every other script, such as one
// injected by a text.

/// Returns the SHA-256 (FIPS 180-4) of bytes.
constexpr std::array<std::uint8_t, 32> sha256(std::string_view bytes) {
  using State = std::array<std::uint32_t, 8>;
  constexpr std::array<std::uint32_t, 64> k{
      0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4,
      0xab1c5ed5, 0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe,
      0x9bdc06a7, 0xc19bf174, 0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f,
      0x4a7484aa, 0x5cb0a9dc, 0x76f988da, 0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7,
      0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967, 0x27b70a85, 0x2e1b2138, 0x4d2c6dfc,
      0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85, 0xa2bfe8a1, 0xa81a664b,
      0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070, 0x19a4c116,
      0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
      0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7,
      0xc67178f2};
  State state{0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
              0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  constexpr std::size_t block = 64, length_bytes = 8;
  const std::size_t padded = (bytes.size() + 1 + length_bytes + block - 1) / block * block;
  const auto byte_at = [&](std::size_t i) -> std::uint8_t {
    if (i < bytes.size()) return static_cast<std::uint8_t>(bytes[i]);
    if (i == bytes.size()) return 0x80;
    const std::size_t from_end = padded - 1 - i;
    return from_end < length_bytes ? std::uint8_t(8 * std::uint64_t(bytes.size()) >> (8 * from_end))
                                   : std::uint8_t(0);
  };
  for (std::size_t begin = 0; begin < padded; begin += block) {
    std::array<std::uint32_t, 64> w{};
    for (std::size_t i = 0; i < 64; ++i)
      if (i < 16)
        for (std::size_t j = 0; j < 4; ++j) w[i] = w[i] << 8 | byte_at(begin + 4 * i + j);
      else
        w[i] = w[i - 16] + w[i - 7] +
               (std::rotr(w[i - 15], 7) ^ std::rotr(w[i - 15], 18) ^ w[i - 15] >> 3) +
               (std::rotr(w[i - 2], 17) ^ std::rotr(w[i - 2], 19) ^ w[i - 2] >> 10);
    auto [a, b, c, d, e, f, g, h] = state;
    for (std::size_t i = 0; i < 64; ++i) {
      const std::uint32_t one = h + (std::rotr(e, 6) ^ std::rotr(e, 11) ^ std::rotr(e, 25)) +
                                ((e & f) ^ (~e & g)) + k[i] + w[i];
      const std::uint32_t two =
          (std::rotr(a, 2) ^ std::rotr(a, 13) ^ std::rotr(a, 22)) + ((a & b) ^ (a & c) ^ (b & c));
      h = g;
      g = f;
      f = e;
      e = d + one;
      d = c;
      c = b;
      b = a;
      a = one + two;
    }
    const State added{a, b, c, d, e, f, g, h};
    for (std::size_t i = 0; i < 8; ++i) state[i] += added[i];
  }
  std::array<std::uint8_t, 32> digest{};
  for (std::size_t i = 0; i < digest.size(); ++i)
    digest[i] = std::uint8_t(state[i / 4] >> (24 - 8 * (i % 4)));
  return digest;
}

/// Returns the source of a script as a Content-Security-Policy names it: 'sha256-...', quotes
/// included.
inline std::string script_hash(std::string_view script) {
  const std::array<std::uint8_t, 32> digest = sha256(script);
  return "'sha256-" + base64({reinterpret_cast<const char*>(digest.data()), digest.size()}) + "'";
}

}  // namespace abbe::sim
