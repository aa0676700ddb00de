#include "sim/report/viewer_source.h"

#define ABBE_FILE(name, file)                                                                   \
  asm(".section .rodata\n.global " #name "\n" #name ":\n.incbin \"" ABBE_VIEWER_FOLDER "/" file \
      "\"\n.global " #name "_end\n" #name "_end:\n.byte 0\n.previous\n")

ABBE_FILE(abbe_words, "words.js");
ABBE_FILE(abbe_viewer_page, "viewer.html");
ABBE_FILE(abbe_viewer_style, "viewer.css");
ABBE_FILE(abbe_viewer_unpack, "unpack.js");
ABBE_FILE(abbe_viewer_script, "viewer.js");
ABBE_FILE(abbe_charts_page, "charts.html");
ABBE_FILE(abbe_charts_style, "charts.css");
ABBE_FILE(abbe_charts_script, "charts.js");

extern "C" {
extern const char abbe_words[], abbe_words_end[];
extern const char abbe_viewer_page[], abbe_viewer_page_end[];
extern const char abbe_viewer_style[], abbe_viewer_style_end[];
extern const char abbe_viewer_unpack[], abbe_viewer_unpack_end[];
extern const char abbe_viewer_script[], abbe_viewer_script_end[];
extern const char abbe_charts_page[], abbe_charts_page_end[];
extern const char abbe_charts_style[], abbe_charts_style_end[];
extern const char abbe_charts_script[], abbe_charts_script_end[];
}

namespace abbe::sim {

std::string_view viewer_page() { return {abbe_viewer_page, abbe_viewer_page_end}; }
std::string_view viewer_style() { return {abbe_viewer_style, abbe_viewer_style_end}; }
std::string_view charts_page() { return {abbe_charts_page, abbe_charts_page_end}; }
std::string_view charts_style() { return {abbe_charts_style, abbe_charts_style_end}; }

std::string viewer_script() {
  std::string all(abbe_words, abbe_words_end);
  all.append(abbe_viewer_unpack, abbe_viewer_unpack_end);
  return all.append(abbe_viewer_script, abbe_viewer_script_end);
}

std::string charts_script() {
  std::string all(abbe_words, abbe_words_end);
  return all.append(abbe_charts_script, abbe_charts_script_end);
}

}  // namespace abbe::sim
