#include "render/page.h"

#include <cmath>

#include "kinematics/units.h"
#include "render/axes.h"

namespace abbe::render {
namespace {

using Eigen::Vector2d;

constexpr double side_margin = 40.0;  // of the chosen size

std::vector<std::string> caption_lines(int width, const std::vector<std::string>& caption,
                                       const TextStyle& body, double unit) {
  std::vector<std::string> lines;
  for (const std::string& line : caption)
    for (const std::string& part : wrapped(line, body, width - 2.0 * side_margin * unit))
      lines.push_back(part);
  return lines;
}

/// The sign of a series in a legend, about `left` and as wide as two letters.
void draw_sign(Canvas& canvas, const Vector2d& left, const LegendEntry& entry, double size) {
  const Vector2d right = left + Vector2d(2.0 * size, 0.0);
  if (entry.band)
    canvas.fill({left.x(), left.y() - 0.4 * size, 2.0 * size, 0.8 * size},
                series_colour(entry.colour), 0.2);
  if (entry.line) stroke(canvas, {left, right}, entry.colour, 0.16 * size);
  if (entry.points) draw_mark(canvas, 0.5 * (left + right), entry.colour, 0.5 * size);
}

}  // namespace

Page page(int width, int height, const std::string& title, const std::vector<std::string>& caption,
          double unit) {
  Page p;
  p.width = width;
  p.height = height;
  p.unit = unit;
  p.title = {.size_px = 36.0 * unit, .bold = true};
  p.body = {.size_px = 22.0 * unit};
  const double m = side_margin * unit;
  if (!title.empty()) p.title_lines = wrapped(title, p.title, width - 2.0 * m, 2);
  p.caption_lines = caption_lines(width, caption, p.body, unit);
  const double above = 0.6 * m + double(p.title_lines.size()) * line_height(p.title);
  const double below = 0.6 * m + double(p.caption_lines.size()) * line_height(p.body);
  p.inner = {0.5 * m, below, width - m, height - above - below};
  return p;
}

double page_margins(int width, const std::string& title, const std::vector<std::string>& caption,
                    double unit) {
  constexpr int height = 1000;  // the margins are the same for any
  return height - page(width, height, title, caption, unit).inner.height;
}

void draw_page(Canvas& canvas, const Page& p) {
  const double m = side_margin * p.unit;
  paragraph(canvas, {m, p.height - 0.5 * m}, p.title_lines, p.title);
  paragraph(canvas, {m, 0.5 * m + double(p.caption_lines.size()) * line_height(p.body)},
            p.caption_lines, p.body);
}

void draw_mark(Canvas& canvas, const Vector2d& at, int colour, double size_px) {
  constexpr int corners[] = {12, 4, 4, 3};
  constexpr double turns[] = {0.0, 0.125, 0.0, 0.25};
  const int kind = colour % 4;
  std::vector<Vector2d> shape;
  for (int i = 0; i < corners[kind]; ++i) {
    const double angle = 2.0 * pi * (turns[kind] + double(i) / corners[kind]);
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
    draw_sign(canvas, at - Vector2d(0.0, 0.62 * style.size_px), entry, style.size_px);
    at.y() -= paragraph(canvas, at + Vector2d(indent, 0.0),
                        wrapped(entry.name, style, width - indent, 3), style) +
              0.3 * style.size_px;
  }
  if (!entries.empty() && !note.empty()) at.y() -= 0.6 * style.size_px;
  for (const std::string& line : note)
    at.y() -= paragraph(canvas, at, wrapped(line, style, width, 3), style);
  return top_left.y() - at.y();
}

double draw_legend_row(Canvas& canvas, const Vector2d& left,
                       const std::vector<LegendEntry>& entries, const TextStyle& style) {
  TextStyle beside = style;
  beside.upward = 0.5;
  Vector2d at = left;
  for (const LegendEntry& entry : entries) {
    draw_sign(canvas, at, entry, style.size_px);
    at.x() += 2.6 * style.size_px;
    canvas.text(at, entry.name, beside);
    at.x() += text_size(entry.name, beside).x() + 1.8 * style.size_px;
  }
  return at.x() - left.x();
}

}  // namespace abbe::render
