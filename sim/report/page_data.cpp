#include "sim/report/page_data.h"

namespace abbe::sim {

using nlohmann::ordered_json;

void add_block(PageData& data, const std::string& name, const std::string& text) {
  data.blocks += "<script type=\"text/plain\" id=\"a:" + name + "\">" + text + "</script>\n";
}

void add(PageData& data, const PageArray& array, const Packed& packed) {
  ordered_json about{{"n", packed.rows}, {"components", packed.columns}, {"mesh", array.on_mesh}};
  for (const Prediction by : packed.by) about["by"].push_back(int(by));
  if (packed.reference >= 0) about["reference"] = array.references[std::size_t(packed.reference)];
  if (packed.has_missing) about["missing"] = true;
  if (!packed.step.empty()) {
    about["offset"] = packed.offset;
    about["step"] = packed.step;
  }
  data.index["arrays"][array.name] = about;
  add_block(data, array.name, packed.text);
}

ordered_json to_json(const Eigen::Isometry3d& T) {
  const Eigen::Matrix4d m = T.matrix();
  return std::vector<double>(m.data(), m.data() + m.size());
}

ordered_json to_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace abbe::sim
