#include "render/fonts.h"

#include <cstdint>
#include <filesystem>

namespace abbe::render {
namespace {

/// A font that Debian has, and the package that brings it.
struct Font {
  const char* regular;
  const char* bold;
  const char* package;
};

constexpr Font western{"/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
                       "/usr/share/fonts/truetype/dejavu/DejaVuSans-Bold.ttf", "fonts-dejavu-core"};
// which has no bold face
constexpr Font eastern{"/usr/share/fonts/truetype/wqy/wqy-microhei.ttc",
                       "/usr/share/fonts/truetype/wqy/wqy-microhei.ttc", "fonts-wqy-microhei"};

/// Whether a text has letters of China, Japan or Korea: U+2E80 to U+D7FF and the wide forms, of
/// which the first byte in UTF-8 says enough.
bool is_eastern(const std::string& text) {
  for (std::size_t i = 0; i + 1 < text.size(); ++i) {
    const auto first = static_cast<std::uint8_t>(text[i]);
    const auto second = static_cast<std::uint8_t>(text[i + 1]);
    if ((first == 0xE2 && second >= 0xBA) || (first >= 0xE3 && first <= 0xED) ||
        (first == 0xEF && second >= 0xA4) || (first == 0xF0 && second >= 0xA0))
      return true;
  }
  return false;
}

const Font& font_of(const std::string& text) { return is_eastern(text) ? eastern : western; }

bool is_there(const char* file) {
  std::error_code none;
  return std::filesystem::is_regular_file(file, none);
}

}  // namespace

std::string font_file(const std::string& text, bool bold) {
  const Font& font = font_of(text);
  const char* file = bold ? font.bold : font.regular;
  return is_there(file) ? file : "";
}

std::string missing_font_package(const std::string& text) {
  const Font& font = font_of(text);
  return is_there(font.regular) && is_there(font.bold) ? "" : font.package;
}

}  // namespace abbe::render
