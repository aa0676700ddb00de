#include "render/layout.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <numeric>
#include <string_view>

#include "render/label.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;

bool is_continuation(char c) { return (static_cast<unsigned char>(c) & 0xC0u) == 0x80u; }

/// The longest beginning of `text` that fits with an ellipsis.
std::string shortened(std::string text, const TextStyle& style, double width) {
  while (!text.empty()) {
    while (text.size() > 1 && is_continuation(text.back())) text.pop_back();
    text.pop_back();
    const std::string shown = text + "…";
    if (text_size(shown, style).x() <= width) return shown;
  }
  return {};
}

/// Whether a unit stands there, which stays with its number.
bool unit_at(std::string_view text) {
  constexpr std::array units = {"%", "µm", "nm", "mm"};
  return std::ranges::any_of(units, [&](const char* unit) { return text.starts_with(unit); });
}

/// Whether a sign ends there, which stays with the number that follows.
bool sign_before(std::string_view text) {
  constexpr std::array signs = {" ±", " <", " >"};
  return std::ranges::any_of(signs, [&](const char* sign) { return text.ends_with(sign); });
}

/// Words of text, each up to and including a space, in pieces that end at a hyphen or an
/// underscore: there a word is parted that is longer than a line.
std::vector<std::vector<std::string>> words(const std::string& text) {
  std::vector<std::vector<std::string>> found(1, std::vector<std::string>(1));
  for (std::size_t i = 0; i < text.size(); ++i) {
    found.back().back() += text[i];
    const bool inner = i > 0 && i + 1 < text.size();
    const bool hyphen = text[i] == '-' && inner && text[i - 1] != ' ' && text[i + 1] != ' ';
    const bool number = inner && std::isdigit(static_cast<unsigned char>(text[i - 1]));
    const std::string_view all = text;
    const bool space = text[i] == ' ' && !(number && unit_at(all.substr(i + 1))) &&
                       !(inner && sign_before(all.substr(0, i)));
    if (space)
      found.emplace_back(1);
    else if (hyphen || (text[i] == '_' && inner))
      found.back().emplace_back();
  }
  return found;
}

}  // namespace

TypeSizes type_sizes(int width, int height) {
  const double unit = std::max(0.4, std::min(width / 1600.0, height / 1200.0));
  return {36.0 * unit, 28.0 * unit, 22.0 * unit, unit};
}

std::vector<std::string> wrapped(const std::string& text, const TextStyle& style, double width,
                                 std::size_t most) {
  const auto fits = [&](const std::string& line) { return text_size(line, style).x() <= width; };
  if (fits(text)) return {text};
  std::vector<std::string> lines(1);
  bool is_full = false;
  const auto append = [&](const std::string& piece) {
    if (!is_full && !lines.back().empty() && !fits(lines.back() + piece)) {
      is_full = lines.size() == most;
      if (!is_full) lines.emplace_back();
    }
    lines.back() += piece;
  };
  for (const std::vector<std::string>& pieces : words(text)) {
    const std::string word = std::accumulate(pieces.begin(), pieces.end(), std::string());
    if (fits(word) && lines.size() < most)
      append(word);
    else
      for (const std::string& piece : pieces) append(piece);
  }
  for (std::string& line : lines) {
    if (!fits(line)) line = shortened(line, style, width);
  }
  return lines;
}

double line_height(const TextStyle& style) { return std::round(1.38 * style.size_px); }

double paragraph(Canvas& canvas, const Vector2d& top_left, const std::vector<std::string>& lines,
                 const TextStyle& style) {
  TextStyle hung = style;
  hung.upward = 1.0;
  double y = top_left.y();
  for (const std::string& line : lines) {
    canvas.text({top_left.x(), y}, line, hung);
    y -= line_height(style);
  }
  return top_left.y() - y;
}

std::string grouped(std::size_t count) {
  std::string digits = std::to_string(count);
  for (int i = static_cast<int>(digits.size()) - 3; i > 0; i -= 3) digits.insert(i, " ");
  return digits;
}

void scale_bar(Canvas& canvas, const View& view, const Vector2d& left, double longest_px,
               const TextStyle& style) {
  const double longest = longest_px * view.mm_per_px;
  double length = round_up_125(longest);
  if (length > longest) length = round_up_125(0.39 * length);  // the next smaller of 1, 2, 5
  const double px = length / view.mm_per_px;
  const double width = std::max(2.0, style.size_px / 9.0);
  const double tick = style.size_px * 0.35;
  canvas.line({left, left + Vector2d(px, 0)}, style.colour, width);
  for (const double x : {0.0, px}) {
    canvas.line({left + Vector2d(x, -tick), left + Vector2d(x, tick)}, style.colour, width);
  }
  TextStyle beside = style;
  beside.across = 0.0;
  beside.upward = 0.5;
  canvas.text(left + Vector2d(px + 0.6 * style.size_px, 0),
              fixed(length, round_decimals(length)) + " mm", beside);
}

void triad(Canvas& canvas, const View& view, const Vector2d& centre, double radius,
           const TextStyle& style) {
  constexpr std::array<const char*, 3> names{"X", "Y", "Z"};
  const double width = std::max(2.0, style.size_px / 9.0);
  TextStyle centred = style;
  centred.across = centred.upward = 0.5;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(i);
    const Vector2d d(axis.dot(view.right), axis.dot(view.up));
    const double length = d.norm();
    if (length < 0.05) {  // along the line of sight
      const double s = 1.4 * width;
      canvas.fill({centre.x() - s, centre.y() - s, 2 * s, 2 * s}, style.colour);
      canvas.text(centre + Vector2d(-0.8, -0.8) * style.size_px, names[i], centred);
      continue;
    }
    const Vector2d along = d / length;
    const Vector2d across(-along.y(), along.x());
    const Vector2d tip = centre + radius * d;
    const double head = 3.2 * width;
    canvas.line({centre, tip - 0.5 * head * along}, style.colour, width);
    canvas.fill(
        {tip, tip - head * along + 0.4 * head * across, tip - head * along - 0.4 * head * across},
        style.colour);
    canvas.text(tip + 0.75 * style.size_px * along, names[i], centred);
  }
}

double swatch(Canvas& canvas, const Vector2d& left, const Colour& colour, const std::string& label,
              const TextStyle& style) {
  const double side = 0.9 * style.size_px;
  canvas.fill({left.x(), std::round(left.y() - 0.5 * side), side, side}, colour);
  TextStyle beside = style;
  beside.across = 0.0;
  beside.upward = 0.5;
  canvas.text(left + Vector2d(side + 0.45 * style.size_px, 0), label, beside);
  return side + 0.45 * style.size_px + text_size(label, style).x();
}

}  // namespace abbe::render
