#include "errors/metrology/position_file.h"

#include "errors/metrology/position_csv.h"
#include "errors/metrology/position_rtl.h"
#include "kinematics/text.h"

namespace abbe::errors::metrology {

std::vector<PositionSet> read_positions(std::string_view text, const std::string& file,
                                        const PositionFileOptions& options) {
  const std::size_t start = text.find_first_not_of("\xef\xbb\xbf \t\r\n");
  if (start != std::string_view::npos && text.substr(start).starts_with("HEADER::"))
    return {read_rtl(text, file, options)};
  return read_position_csv(text, file, options);
}

std::vector<PositionSet> read_position_file(const std::filesystem::path& file,
                                            const PositionFileOptions& options) {
  return read_positions(read_text(file, options.max_bytes), file.string(), options);
}

}  // namespace abbe::errors::metrology
