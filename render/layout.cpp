#include "render/layout.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <numeric>
#include <string_view>

#include "kinematics/units.h"
#include "render/figures.h"

namespace abbe::render {

using Eigen::Vector2d;

namespace {

// In UTF-8, continuation bytes are 10xxxxxx; a text must not be cut before one.
bool is_continuation(char c) { return (static_cast<unsigned char>(c) & 0xC0u) == 0x80u; }

/// Returns the longest beginning of `text` that fits together with an ellipsis.
std::string shortened(std::string text, const TextStyle& style, double width) {
  while (!text.empty()) {
    while (text.size() > 1 && is_continuation(text.back())) text.pop_back();
    text.pop_back();
    const std::string shown = text + "…";
    if (text_size(shown, style).x() <= width) return shown;
  }
  return {};
}

/// Returns true if the text begins with a unit, which must stay with the preceding number.
bool starts_with_unit(std::string_view text) {
  constexpr std::array units = {"%", "µm", "nm", "mm"};
  return std::ranges::any_of(units, [&](const char* unit) { return text.starts_with(unit); });
}

/// Returns true if the text ends with a sign that must stay with the following number.
bool ends_with_sign(std::string_view text) {
  constexpr std::array signs = {" ±", " <", " >"};
  return std::ranges::any_of(signs, [&](const char* sign) { return text.ends_with(sign); });
}

/// Splits a text into words, each with its trailing space, and each word into parts that end at a
/// hyphen or an underscore. A word that is longer than a line is divided between its parts.
std::vector<std::vector<std::string>> split_words(const std::string& text) {
  std::vector<std::vector<std::string>> words(1, std::vector<std::string>(1));
  const std::string_view view = text;
  for (std::size_t i = 0; i < text.size(); ++i) {
    words.back().back() += text[i];
    const bool is_inner = i > 0 && i + 1 < text.size();
    const bool is_hyphen = text[i] == '-' && is_inner && text[i - 1] != ' ' && text[i + 1] != ' ';
    const bool follows_digit = is_inner && std::isdigit(static_cast<unsigned char>(text[i - 1]));
    const bool is_word_end = text[i] == ' ' &&
                             !(follows_digit && starts_with_unit(view.substr(i + 1))) &&
                             !(is_inner && ends_with_sign(view.substr(0, i)));
    if (is_word_end)
      words.emplace_back(1);
    else if (is_hyphen || (text[i] == '_' && is_inner))
      words.back().emplace_back();
  }
  return words;
}

}  // namespace

TypeSizes type_sizes(int width, int height) {
  // Letters below 0.4 of the reference size would be illegible.
  const double unit = std::max(0.4, std::min(width / 1600.0, height / 1200.0));
  return {36.0 * unit, 28.0 * unit, 22.0 * unit, unit};
}

std::vector<std::string> wrap_text(const std::string& text, const TextStyle& style, double width,
                                   std::size_t max_lines) {
  const auto fits = [&](const std::string& line) { return text_size(line, style).x() <= width; };
  if (fits(text)) return {text};
  std::vector<std::string> lines(1);
  bool is_full = false;
  const auto append = [&](const std::string& piece) {
    if (!is_full && !lines.back().empty() && !fits(lines.back() + piece)) {
      is_full = lines.size() == max_lines;
      if (!is_full) lines.emplace_back();
    }
    lines.back() += piece;
  };
  for (const std::vector<std::string>& parts : split_words(text)) {
    const std::string word = std::accumulate(parts.begin(), parts.end(), std::string());
    // A word that fits into a line of its own is not divided.
    if (fits(word) && lines.size() < max_lines)
      append(word);
    else
      for (const std::string& part : parts) append(part);
  }
  for (std::string& line : lines) {
    if (!fits(line)) line = shortened(line, style, width);
  }
  return lines;
}

// The usual line spacing of DejaVu Sans is 1.38 of its size.
double line_height(const TextStyle& style) { return std::round(1.38 * style.size_px); }

double draw_paragraph(Canvas& canvas, const Vector2d& top_left,
                      const std::vector<std::string>& lines, const TextStyle& style) {
  TextStyle top_anchored = style;
  top_anchored.vertical_anchor = 1.0;
  double y = top_left.y();
  for (const std::string& line : lines) {
    canvas.text({top_left.x(), y}, line, top_anchored);
    y -= line_height(style);
  }
  return top_left.y() - y;
}

std::string group_digits(std::size_t count) {
  std::string digits = std::to_string(count);
  for (int i = static_cast<int>(digits.size()) - 3; i > 0; i -= 3) digits.insert(i, " ");
  return digits;
}

void draw_scale_bar(Canvas& canvas, const View& view, const Vector2d& left, double longest_px,
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
  TextStyle label_style = style;
  label_style.horizontal_anchor = 0.0;
  label_style.vertical_anchor = 0.5;
  canvas.text(left + Vector2d(px + 0.6 * style.size_px, 0),
              fixed(length, round_decimals(length)) + " mm", label_style);
}

void draw_triad(Canvas& canvas, const View& view, const Vector2d& centre, double radius,
                const TextStyle& style) {
  constexpr std::array<const char*, 3> names{"X", "Y", "Z"};
  const double width = std::max(2.0, style.size_px / 9.0);
  TextStyle centred = style;
  centred.horizontal_anchor = centred.vertical_anchor = 0.5;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(i);
    const Vector2d projected_axis(axis.dot(view.right), axis.dot(view.up));
    const double length = projected_axis.norm();
    if (length < 0.05) {  // parallel to the line of sight
      const double s = 1.4 * width;
      canvas.fill({centre.x() - s, centre.y() - s, 2 * s, 2 * s}, style.colour);
      canvas.text(centre + Vector2d(-0.8, -0.8) * style.size_px, names[i], centred);
      continue;
    }
    const Vector2d along = projected_axis / length;
    const Vector2d across(-along.y(), along.x());
    const Vector2d tip = centre + radius * projected_axis;
    const double head = 3.2 * width;
    canvas.line({centre, tip - 0.5 * head * along}, style.colour, width);
    canvas.fill(
        {tip, tip - head * along + 0.4 * head * across, tip - head * along - 0.4 * head * across},
        style.colour);
    canvas.text(tip + 0.75 * style.size_px * along, names[i], centred);
  }
}

double draw_swatch(Canvas& canvas, const Vector2d& left, const Colour& colour,
                   const std::string& label, const TextStyle& style) {
  const double side = 0.9 * style.size_px;
  canvas.fill({left.x(), std::round(left.y() - 0.5 * side), side, side}, colour);
  TextStyle label_style = style;
  label_style.horizontal_anchor = 0.0;
  label_style.vertical_anchor = 0.5;
  canvas.text(left + Vector2d(side + 0.45 * style.size_px, 0), label, label_style);
  return side + 0.45 * style.size_px + text_size(label, style).x();
}

Vector2d at(const Axes& axes, double x, double y) {
  return {axes.box.x + axes.box.width * (x - axes.x.lower) / (axes.x.upper - axes.x.lower),
          axes.box.y + axes.box.height * (y - axes.y.lower) / (axes.y.upper - axes.y.lower)};
}

void widen(Span& span, double value) {
  span.lower = std::min(span.lower, value);
  span.upper = std::max(span.upper, value);
}

Span pad_span(Span span) {
  const double size = span.upper - span.lower;
  // For a constant series the margin is a tenth of its value.
  const double margin = size > 0.0 ? 0.06 * size : std::max(1e-6, 0.1 * std::abs(span.lower));
  return {span.lower - margin, span.upper + margin};
}

// The first, lowest, highest and last point in a column of pixels give the same picture as all of
// its points.
std::vector<Vector2d> decimate_curve(const std::vector<Vector2d>& points) {
  std::vector<Vector2d> result;
  for (std::size_t i = 0; i < points.size();) {
    const double column = std::floor(points[i].x());
    std::size_t end = i;
    std::size_t low = i;
    std::size_t high = i;
    for (; end < points.size() && std::floor(points[end].x()) == column; ++end) {
      if (points[end].y() < points[low].y()) low = end;
      if (points[end].y() > points[high].y()) high = end;
    }
    std::array<std::size_t, 4> selected{i, std::min(low, high), std::max(low, high), end - 1};
    const auto selected_end = std::unique(selected.begin(), selected.end());
    for (auto k = selected.begin(); k != selected_end; ++k) result.push_back(points[*k]);
    i = end;
  }
  return result;
}

void draw_series_line(Canvas& canvas, const std::vector<Vector2d>& points, int index,
                      double width_px) {
  // Dashes and gaps in line widths distinguish series of the same colour.
  const std::vector<double> dashes[] = {
      {}, {5.0 * width_px, 3.0 * width_px}, {1.5 * width_px, 2.0 * width_px}};
  canvas.line(points, series_colour(index), width_px, dashes[std::min(index / series_colours, 2)]);
}

namespace {

constexpr double side_margin = 40.0;  // px at the reference size

std::vector<std::string> caption_lines(int width, const std::vector<std::string>& caption,
                                       const TextStyle& body, double unit) {
  std::vector<std::string> lines;
  for (const std::string& line : caption)
    for (const std::string& part : wrap_text(line, body, width - 2.0 * side_margin * unit))
      lines.push_back(part);
  return lines;
}

/// Draws the symbols of a legend entry, starting at `left` and twice as wide as the text size.
void draw_symbol(Canvas& canvas, const Vector2d& left, const LegendEntry& entry, double size) {
  const Vector2d right = left + Vector2d(2.0 * size, 0.0);
  if (entry.band)
    canvas.fill({left.x(), left.y() - 0.4 * size, 2.0 * size, 0.8 * size},
                series_colour(entry.colour), 0.2);
  if (entry.line) draw_series_line(canvas, {left, right}, entry.colour, 0.16 * size);
  if (entry.points) draw_mark(canvas, 0.5 * (left + right), entry.colour, 0.5 * size);
}

}  // namespace

Page page(int width, int height, const std::string& title, const std::vector<std::string>& caption,
          double unit) {
  Page sheet;
  sheet.width = width;
  sheet.height = height;
  sheet.unit = unit;
  sheet.title = {.size_px = 36.0 * unit, .bold = true};
  sheet.body = {.size_px = 22.0 * unit};
  const double m = side_margin * unit;
  if (!title.empty()) sheet.title_lines = wrap_text(title, sheet.title, width - 2.0 * m, 2);
  sheet.caption_lines = caption_lines(width, caption, sheet.body, unit);
  const double above = 0.6 * m + double(sheet.title_lines.size()) * line_height(sheet.title);
  const double below = 0.6 * m + double(sheet.caption_lines.size()) * line_height(sheet.body);
  sheet.inner = {0.5 * m, below, width - m, height - above - below};
  return sheet;
}

double page_margins(int width, const std::string& title, const std::vector<std::string>& caption,
                    double unit) {
  constexpr int height = 1000;  // arbitrary: the margins do not depend on it
  return height - page(width, height, title, caption, unit).inner.height;
}

void draw_page(Canvas& canvas, const Page& page) {
  const double m = side_margin * page.unit;
  draw_paragraph(canvas, {m, page.height - 0.5 * m}, page.title_lines, page.title);
  draw_paragraph(canvas, {m, 0.5 * m + double(page.caption_lines.size()) * line_height(page.body)},
                 page.caption_lines, page.body);
}

void draw_mark(Canvas& canvas, const Vector2d& at, int colour, double size_px) {
  // Disc, square, diamond and triangle, with the angle of the first corner in revolutions.
  constexpr int corners[] = {12, 4, 4, 3};
  constexpr double first_angles[] = {0.0, 0.125, 0.0, 0.25};
  const int kind = colour % 4;
  std::vector<Vector2d> shape;
  for (int i = 0; i < corners[kind]; ++i) {
    const double angle = 2.0 * pi * (first_angles[kind] + double(i) / corners[kind]);
    // A polygon has less area than a disc of the same radius, so it is drawn larger.
    shape.push_back(at + 0.5 * size_px * (kind == 0 ? 0.9 : 1.15) *
                             Vector2d(std::cos(angle), std::sin(angle)));
  }
  canvas.fill(shape, series_colour(colour));
}

double draw_legend_column(Canvas& canvas, const Vector2d& top_left, double width,
                          const std::vector<LegendEntry>& entries,
                          const std::vector<std::string>& note, const TextStyle& style) {
  const double indent = 2.6 * style.size_px;
  Vector2d at = top_left;
  for (const LegendEntry& entry : entries) {
    draw_symbol(canvas, at - Vector2d(0.0, 0.62 * style.size_px), entry, style.size_px);
    at.y() -= draw_paragraph(canvas, at + Vector2d(indent, 0.0),
                             wrap_text(entry.name, style, width - indent, 3), style) +
              0.3 * style.size_px;
  }
  if (!entries.empty() && !note.empty()) at.y() -= 0.6 * style.size_px;
  for (const std::string& line : note)
    at.y() -= draw_paragraph(canvas, at, wrap_text(line, style, width, 3), style);
  return top_left.y() - at.y();
}

double draw_legend_row(Canvas& canvas, const Vector2d& left,
                       const std::vector<LegendEntry>& entries, const TextStyle& style) {
  TextStyle label_style = style;
  label_style.vertical_anchor = 0.5;
  Vector2d at = left;
  for (const LegendEntry& entry : entries) {
    draw_symbol(canvas, at, entry, style.size_px);
    at.x() += 2.6 * style.size_px;
    canvas.text(at, entry.name, label_style);
    at.x() += text_size(entry.name, label_style).x() + 1.8 * style.size_px;
  }
  return at.x() - left.x();
}

}  // namespace abbe::render
