#include "sim/report/page_template.h"

#include <fmt/format.h>

// The files are embedded by the assembler, so that the browser files stay separate and no literal
// of their size is compiled.
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

/// The scripts stand in one element, so that one hash allows them.
std::string viewer_script() {
  std::string all(abbe_words, abbe_words_end);
  all.append(abbe_viewer_unpack, abbe_viewer_unpack_end);
  return all.append(abbe_viewer_script, abbe_viewer_script_end);
}

std::string charts_script() {
  std::string all(abbe_words, abbe_words_end);
  return all.append(abbe_charts_script, abbe_charts_script_end);
}

namespace {

constexpr ReportLabel labels[] = {
    {"part_tab", "Part", "零件"},
    {"machine_tab", "Machine", "机床"},
    {"text_tab", "Text", "文字"},
    {"cases", "Cases", "工况"},
    {"left_case", "left", "左"},
    {"right_case", "right", "右"},
    {"side", "side by side", "并排"},
    {"swipe", "swipe", "滑动对比"},
    {"difference", "left − right", "左 − 右"},
    {"single", "left only", "仅左"},
    {"layer", "shows", "显示"},
    {"residual", "residual", "偏差"},
    {"form", "form", "形状"},
    {"texture", "texture", "纹理"},
    {"region", "region", "区域"},
    {"whole_part", "whole part", "整个零件"},
    {"in_tolerance", "in tolerance", "合格"},
    {"region_figures", "Figures by region", "各区域的数值"},
    {"in_percent", "in tolerance %", "合格 %"},
    {"scale", "Scale", "色标"},
    {"sign", "+ material left, − gouged", "+ 残留，− 过切"},
    {"from", "from", "从"},
    {"to", "to", "到"},
    {"fit", "fit 99.5 %", "适应 99.5 %"},
    {"tolerance", "tolerance", "公差"},
    {"bands", "bands", "色带"},
    {"smooth", "smooth", "连续"},
    {"relief", "relief", "法向放大"},
    {"off", "off", "关"},
    {"perspective", "perspective", "透视"},
    {"under_cursor", "Under the cursor", "光标处"},
    {"line", "line", "程序行"},
    {"uncut", "uncut", "未加工"},
    {"png", "PNG", "PNG"},
    {"csv", "section CSV", "截面 CSV"},
    {"link", "link to this view", "此视图的链接"},
    {"help",
     "drag turns · right drag or two fingers move · wheel zooms · shift+drag draws a section · "
     "arrows turn · + − zoom · 1 top 2 front 3 side 0 home",
     "拖动旋转 · 右键或双指平移 · 滚轮缩放 · Shift+拖动画截面 · 方向键旋转 · + − 缩放 · 1 顶 2 前 "
     "3 侧 0 初始"},
    {"section", "Section", "截面"},
    {"section_hint", "Section: shift+drag over the surface", "截面：按住 Shift 在表面上拖动"},
    {"along", "mm along the section", "沿截面 mm"},
    {"points", "points", "点"},
    {"histogram", "Histogram", "直方图"},
    {"histogram_y", "√ of percentage of vertices", "顶点百分比的平方根"},
    {"view", "3-D view of the map", "偏差图三维视图"},
    {"busy", "reading the data …", "正在读取数据…"},
    {"cut_off", "This file is incomplete: its end is missing. Copy it again.",
     "文件不完整：缺少结尾，请重新复制。"},
    {"no_webgl", "This browser has no WebGL 2: see the pictures, tables and text below.",
     "此浏览器没有 WebGL 2：图片、表格和文字见下方。"},
    {"lost", "The graphics context was lost; reload the page.", "图形设备丢失，请重新加载页面。"},
    {"cannot", "This report cannot be shown: ", "无法显示此报告："},
    {"time", "Time", "时间"},
    {"play", "play", "播放"},
    {"speed", "speed", "速度"},
    {"of", "of", "/"},
    {"grows", "surface appears as it is cut", "表面随切削显现"},
    {"go_line", "program line", "程序行"},
    {"go", "go", "转到"},
    {"errors", "tool errors", "刀具误差"},
    {"to_tool", "go to the tool", "看刀具"},
    {"signal", "signal", "信号"},
    {"no_signal", "no signal for these cases", "这些工况没有信号"},
    {"tool_off", "tool deviation in the part frame,", "刀具在零件中的偏差"},
    {"go_vertex", "double-click on the part: go to the instant at which it was cut",
     "双击零件：跳到切出该处的时刻"},
    {"figures", "Figures by case", "各工况的数值"},
    {"case", "case", "工况"},
    {"pv", "PV µm", "峰谷值 µm"},
    {"rms", "RMS µm", "均方根 µm"},
    {"mean", "mean µm", "平均 µm"},
    {"std", "std µm", "标准差 µm"},
    {"min", "min µm", "最小 µm"},
    {"max", "max µm", "最大 µm"},
    {"p95_abs", "95 % below µm", "95 % 低于 µm"},
    {"maps_uncut_percent", "uncut area %", "未加工面积 %"},
    {"asked", "Request", "任务"},
    {"scene", "scene", "场景"},
    {"seed", "seed", "随机种子"},
    {"vertices", "vertices", "顶点数"},
    {"moves", "moves", "程序段数"},
    {"datum", "datum", "基准"},
    {"alignment", "alignment", "对齐"},
    {"tolerance_um", "tolerance µm", "公差 µm"},
    {"machine_axes", "Machine: axes from workpiece to tool", "机床：从工件到刀具的轴"},
    {"program", "program", "程序"},
    {"duration", "duration s", "时长 s"},
    {"verdicts", "Verdicts", "结论"},
    {"warnings", "Warnings", "警告"},
    {"none", "none", "无"},
    {"failed", "Failed cases", "失败的工况"},
    {"versions", "Versions", "版本"},
    {"repeat", "How to reproduce it", "如何重现"},
    {"precision", "resolution of the values nm", "数值步长 nm"},
    {"packed",
     "Precision of the packed data: residual and form, half the resolution in the table; "
     "positions, 1/65534 of the largest extent; cutting times, 0.01 s.",
     "数据精度：偏差和形状为表中步长的一半；位置为最大尺寸的 1/65534；切削时刻 0.01 s。"},
    {"packed_motion",
     "Precision of the motion: axes, 10 µm and 0.01°; spindles, 1°; deviations of the tool, 1/50 "
     "of the largest or 50 nm; signals, 1/500 of their range. Constant signals and data recorded "
     "before the program are omitted.",
     "运动数据：轴 10 µm 和 0.01°；主轴 1°；刀具偏差为最大值的 1/50 或 50 nm；信号为其变化范围的 "
     "1/500。不含恒定的信号和程序开始之前的记录。"},
    {"language", "中文", "English"},
};

}  // namespace

std::span<const ReportLabel> report_labels() { return labels; }

namespace {

constexpr ReportLabel charts[] = {
    {"contents", "Contents", "目录"},
    {"shown_group", "shown", "显示"},
    {"order", "order", "排序"},
    {"order_size", "as listed", "默认顺序"},
    {"order_name", "by name", "按名称"},
    {"show_all", "show all", "全部显示"},
    {"show_less", "show fewer", "只显示前面部分"},
    {"picture", "picture", "图片"},
    {"csv_all", "CSV", "CSV"},
    {"running_sum", "running sum", "累计"},
    {"up_to_here", "up to here", "至此累计"},
    {"share_of_machines", "fraction of the machines / %", "机床占比 / %"},
    {"limit", "limit", "限值"},
    {"unit", "unit", "单位"},
    {"value", "value", "数值"},
    {"figure", "figure", "指标"},
    {"folder", "folder", "文件夹"},
    // studies
    {"study", "study", "研究"},
    {"study_engine", "engine", "计算方式"},
    {"study_seed", "seed", "随机种子"},
    {"study_cases", "cases", "算例数"},
    {"study_failed_cases", "cases without a result", "无结果的算例"},
    {"study_inputs", "inputs", "输入数"},
    {"study_figures", "Figures by response", "各响应的数值"},
    {"study_figures_note",
     "Base: every input at its centre. Root-sum-square and sum: over the larger change caused by "
     "each input alone. Worst found: worst of the corners tried. Brackets are 95 % confidence "
     "intervals.",
     "基准：所有输入取中心值。平方和根与总和：取各输入单独变化的较大值。最坏：所试角点中的最坏值。"
     "方括号以 95 % 的置信度包含真值。"},
    {"arm", "variant and case", "变体与工况"},
    {"response", "response", "响应"},
    {"response_pv", "PV", "峰谷值"},
    {"response_rms", "RMS", "均方根"},
    {"response_mean", "mean", "平均值"},
    {"response_std", "standard deviation", "标准差"},
    {"response_max_abs", "largest deviation", "最大偏差"},
    {"response_p95_abs", "P95 of the absolute deviation", "偏差大小的 P95"},
    {"response_in_tolerance", "area in tolerance", "公差内面积"},
    {"response_form_pv", "PV of form", "形状峰谷值"},
    {"response_form_rms", "RMS of form", "形状均方根"},
    {"response_texture_sa", "Sa of texture", "纹理 Sa"},
    {"response_texture_sq", "Sq of texture", "纹理 Sq"},
    {"response_texture_sz", "Sz of texture", "纹理 Sz"},
    {"base", "base", "基准"},
    {"root_sum_square", "root-sum-square", "平方和根"},
    {"sum", "sum", "总和"},
    {"worst", "worst found", "找到的最坏值"},
    {"worst_bound", "at most", "上界"},
    {"machines_mean", "mean", "平均"},
    {"machines_standard_deviation", "std. dev.", "标准差"},
    {"machines_median", "median", "中位数"},
    {"machines_p95", "P95", "P95"},
    {"machines_p99", "P99", "P99"},
    {"machines_min", "smallest", "最小"},
    {"machines_max", "largest", "最大"},
    {"within", "within the limit", "限值内"},
    {"cpk", "Cpk", "Cpk"},
    {"pareto_map", "Contributions to the map", "偏差图的来源"},
    {"share", "fraction", "占比"},
    {"share_of_map", "fraction of the mean square of the map caused by inputs",
     "在输入造成的偏差图均方中的占比"},
    {"map_rms", "map over random machines: RMS", "随机机床的偏差图：均方根"},
    {"map_mean_rms", "part not caused by inputs (cusps, centres): RMS",
     "其中与输入无关（残留高度、中心值）：均方根"},
    {"pareto_response", "Contributions to the response", "响应的来源"},
    {"share_of_sobol", "fraction of the variance, first-order Sobol indices",
     "方差占比，一阶 Sobol 指数"},
    {"share_of_change", "fraction of the sum of squares, one input at a time",
     "平方和占比，逐一变化"},
    {"share_of_main_effect",
     "fraction of the variance, by a linear and quadratic fit to each input",
     "方差占比，按各输入的直线与抛物线"},
    {"other_inputs", "other inputs", "其他输入"},
    {"no_input_alone", "not due to a single input", "非单一输入"},
    {"tornado", "One input at a time", "逐一变化"},
    {"centre", "centre", "中心"},
    {"deviations", "std. dev.", "标准差"},
    {"change_of_response", "change of the response from the base", "响应相对基准的变化"},
    {"sobol", "Sobol indices", "Sobol 指数"},
    {"sobol_total", "total", "总指数"},
    {"sobol_first", "alone", "一阶指数"},
    {"sobol_note",
     "Fraction of the variance caused by an input with all its interactions (total) and alone; "
     "lines are 95 % confidence intervals.",
     "输入连同其全部交互作用（总指数）及单独（一阶指数）造成的方差占比；线段为 95 % 置信带。"},
    {"share_of_variance", "fraction of the variance", "方差占比"},
    {"distribution", "Random machines", "随机机床"},
    {"every_input", "All inputs", "全部输入"},
    {"input", "input", "输入"},
    {"deviation", "std. dev.", "标准差"},
    {"input_low", "change at centre − step", "中心 − 步长处的变化"},
    {"input_high", "change at centre + step", "中心 + 步长处的变化"},
    {"input_sobol_first", "first-order index", "一阶指数"},
    {"input_sobol_total", "total index", "总指数"},
    {"input_correlation", "correlation", "相关系数"},
    {"input_rank_correlation", "rank correlation", "秩相关系数"},
    {"input_main_effect_percent", "main effect", "主效应"},
    {"convergence", "Convergence of the Sobol indices", "Sobol 指数随基点数的变化"},
    {"convergence_note",
     "The inputs with the largest total indices, at most twelve; bands are 95 % confidence "
     "intervals, clipped at −0.5 and 1.5.",
     "总指数最大的输入，至多十二个；置信带为 95 %，在 −0.5 和 1.5 处截断。"},
    {"base_points", "base points", "基点数"},
    {"index", "index", "指数"},
    {"allocation", "Required quality of every input", "各输入应达到的水平"},
    {"allocation_note",
     "Factors on the present standard deviations that keep the response within its limit: the same "
     "for all inputs, and at minimum cost.",
     "使响应保持在限值内的现有标准差系数：所有输入相同，以及成本最低。"},
    {"not_attainable", "The limit cannot be kept, even without any spread.",
     "即使没有任何散布也无法保持限值。"},
    {"factor_equal", "factor, all equal", "系数，全部相同"},
    {"deviation_equal", "std. dev., all equal", "标准差，全部相同"},
    {"factor_cheapest", "factor, minimum cost", "系数，成本最低"},
    {"deviation_cheapest", "std. dev., minimum cost", "标准差，成本最低"},
    {"allocation_totals", "Cost of the allocation", "分配的成本"},
    {"allocation_way", "allocation", "分配"},
    {"allocation_equal", "all equal", "全部相同"},
    {"allocation_cheapest", "minimum cost", "成本最低"},
    {"cost", "cost", "成本"},
    {"floor", "response without any spread", "无散布时的响应"},
    {"map_figures", "Figures of the maps", "偏差图的数值"},
    {"maps", "map", "图"},
    {"maps_map", "random machines", "随机机床"},
    {"maps_influence", "influence", "影响图"},
    {"maps_uncertainty", "uncertainty", "不确定度"},
    {"maps_rms_um", "RMS µm", "均方根 µm"},
    {"maps_mean_rms_um", "RMS not caused by inputs µm", "与输入无关部分的均方根 µm"},
    {"maps_flagged_percent", "flagged area %", "标记面积 %"},
    {"maps_gouged_percent", "gouged area %", "过切面积 %"},
    {"maps_vertices", "vertices", "顶点数"},
    {"maps_rivals", "competing passes", "竞争走刀数"},
    {"maps_checks", "machines cut in full as a check", "完整切削校验的机床数"},
    {"maps_flag_um", "flagged beyond µm", "标记阈值 µm"},
    {"maps_confidence_percent", "confidence %", "置信度 %"},
    {"maps_machines", "machines sampled", "抽取的机床数"},
    {"maps_standard_deviation_rms_um", "standard deviation, RMS µm", "标准差，均方根 µm"},
    {"maps_standard_deviation_largest_um", "standard deviation, largest µm", "标准差，最大 µm"},
    {"maps_drawn_standard_deviation_rms_um", "standard deviation of sampled machines, RMS µm",
     "抽取机床的标准差，均方根 µm"},
    {"maps_band_mean_width_um", "mean width of the confidence interval µm", "置信带平均宽度 µm"},
    {"influence_maps", "Influence maps", "影响图"},
    {"influence_maps_note", "Effect of one standard deviation of an input on the surface.",
     "一个标准差的输入对表面的影响。"},
    {"sweep", "Sweep", "扫描"},
    {"proofs", "Influence maps against full cuts", "影响图与完整切削的对比"},
    {"proof_compared", "cases compared", "对比算例数"},
    {"proof_one_sided", "with a result from only one", "仅一方有结果"},
    {"proof_differs", "differ at most by", "最大差异"},
    {"histories", "Thermal model learnt on one day, evaluated on others",
     "在一天学得、在其他天评判的热"},
    {"learnt_on", "learnt on", "学习日"},
    {"judged_on", "evaluated on", "评判日"},
    {"scene_day", "day of the scene", "场景自身的一天"},
    {"same_day", "the same", "同一天"},
    {"uncompensated_rms", "uncompensated RMS", "未补偿均方根"},
    {"compensated_rms", "compensated RMS", "补偿后均方根"},
    {"reduction", "reduction", "减少"},
    {"sensors", "sensors", "传感器"},
    // identifications
    {"machine_name", "machine", "机床"},
    {"method", "method", "方法"},
    {"fit_title", "Results of the fit", "拟合结果"},
    {"fit_count", "readings", "读数数"},
    {"fit_hours", "hours on a real machine", "实际机床上的小时数"},
    {"fit_unknowns", "unknowns", "未知数"},
    {"fit_found", "identified coefficients", "求得的数"},
    {"fit_reduced_chi_square", "reduced chi-square", "约化卡方"},
    {"fit_degrees_of_freedom", "degrees of freedom", "自由度"},
    {"fit_condition", "condition of the design matrix", "设计矩阵条件数"},
    {"curves", "Elements along their axes", "各误差元素随轴位置的变化"},
    {"curves_note",
     "Line: identified value with its 95 % confidence interval. Points: value implied by each "
     "single reading, with everything else as identified.",
     "线：辨识结果及其 95 % 置信带。点：其余均取辨识值时，各读数单独给出的值。"},
    {"identified_band", "identified, 95 % confidence", "辨识结果，95 % 置信带"},
    {"readings", "readings", "读数"},
    {"readings_title", "Readings", "读数"},
    {"numbers", "Coefficients of the belief", "辨识所得的数"},
    {"numbers_note",
     "A coefficient without an uncertainty was not identified: it keeps its initial value.",
     "没有不确定度的数未能求得：保持其初始值。"},
    {"name", "name", "名称"},
    {"standard_uncertainty", "standard uncertainty", "标准不确定度"},
    {"value_by_uncertainty", "value / uncertainty", "数值 / 不确定度"},
    {"remark", "remark", "备注"},
    {"hidden_by", "same readings as", "读数等同于"},
    {"not_read", "no reading depends on it", "没有读数与其有关"},
    {"not_found", "not identified", "未求得"},
    {"confounded", "Confounded coefficients", "混淆的数"},
    {"confounded_note",
     "The readings cannot separate these from others: one unit of each gives the same readings as "
     "these amounts of the others together.",
     "读数无法将它们与其他数区分：每一单位的读数等同于其他数的这些量之和。"},
    {"residuals", "Residuals of the readings", "读数残差"},
    {"residuals_note",
     "Reading minus model, in standard deviations of the instrument, including outliers.",
     "读数减模型，以仪器标准差为单位，含离群值。"},
    {"residual_sd", "residual in standard deviations", "以标准差计的残差"},
    {"residual_rms", "residual RMS, std. dev.", "残差均方根，标准差"},
    {"residual_largest", "largest, std. dev.", "最大，标准差"},
    {"all_readings", "all readings", "全部读数"},
    {"share_of_readings", "fraction of the readings / %", "读数占比 / %"},
    {"file", "file", "文件"},
    {"instrument", "instrument", "仪器"},
    {"kind", "kind", "类型"},
    {"set_ups", "set-ups", "安装次数"},
    {"outliers", "Readings rejected as outliers", "作为离群值剔除的读数"},
    {"row", "row", "行"},
    {"orders", "Orders chosen by cross-validation", "交叉验证选定的阶数"},
    {"element", "element", "误差元素"},
    {"chosen_order", "order", "阶数"},
    {"sensor_slopes", "Dependence on temperatures", "随温度的变化"},
    {"sensor", "sensor", "传感器"},
    {"slope_per_K", "slope", "斜率"},
    {"slopes_by_start", "Slopes at every start", "各次启动的斜率"},
    {"slope_with_band", "slope, 95 % confidence", "斜率，95 % 置信带"},
    {"slope", "slope", "斜率"},
    {"start", "start", "启动"},
    {"terms_by_hour", "Thermal effects over the day", "一天中热的影响"},
    // evaluations
    {"yes", "yes", "是"},
    {"no", "no", "否"},
    {"temperatures", "Temperatures", "温度"},
    {"deviation_read", "deviation", "偏差"},
    {"over_position", "Deviations against commanded position", "偏差随指令位置的变化"},
    {"over_position_note",
     "Actual minus target; straightness minus its reference line, radial error motion minus its "
     "once-per-revolution component. Bands are ± 2 s, points are single runs.",
     "实际减目标；直线度已去除其直线，径向误差运动已去除一次成分。带宽为 2 s，点为单次行程。"},
    {"up_2s", "up ± 2 s", "正向 ± 2 s"},
    {"down_2s", "down ± 2 s", "负向 ± 2 s"},
    {"single_runs", "single runs", "单次行程"},
    {"along_diagonal", "along the diagonal", "沿对角线"},
    {"circles", "Circular deviations", "圆偏差"},
    {"anticlockwise", "anticlockwise", "逆时针"},
    {"clockwise", "clockwise", "顺时针"},
    {"least_squares_centre", "about the least-squares centre", "相对最小二乘圆心"},
    {"centre_as_set", "about the set-up centre", "相对设定圆心"},
    {"drifts", "Drift", "漂移"},
    {"drift", "drift", "漂移"},
    {"part_deviations", "Deviations of the part", "零件偏差"},
    {"pictures", "Pictures", "图片"},
};

}  // namespace

std::span<const ReportLabel> chart_labels() { return charts; }

}  // namespace abbe::sim

namespace abbe::sim::html {

using nlohmann::ordered_json;

std::string html_escaped(std::string_view text) {
  std::string out;
  for (const char c : text) switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  return out;
}

std::string in_script(const ordered_json& json) {
  std::string out;
  // "<" is escaped, so that no text can end the script element.
  for (const char c : json.dump(-1, ' ', false, ordered_json::error_handler_t::replace))
    out += c == '<' ? std::string("\\u003c") : std::string(1, c);
  return out;
}

std::string label(const char* key, const char* element) {
  return fmt::format("<{0} data-label=\"{1}\"></{0}>", element, key);
}

std::string row(const char* key, const std::string& value) {
  return "<dt>" + label(key) + "</dt><dd>" + html_escaped(value) + "</dd>";
}

std::string list(const std::vector<std::string>& lines) {
  if (lines.empty()) return "<p>" + label("none") + "</p>";
  std::string text = "<ul>";
  for (const std::string& line : lines) text += "<li>" + html_escaped(line) + "</li>";
  return text + "</ul>";
}

ordered_json labels_json(std::span<const ReportLabel> labels) {
  ordered_json json;
  for (const ReportLabel& one : labels)
    json[std::string(one.key)] = {{"en", one.en}, {"zh", one.zh}};
  return json;
}

std::string insert_labels(std::string_view page, std::span<const ReportLabel> labels,
                          const std::string& language) {
  std::map<std::string_view, std::string_view> words;
  for (const ReportLabel& one : labels) words[one.key] = language == "zh" ? one.zh : one.en;
  constexpr std::string_view begin = "data-label=\"", end = "\">";
  std::string text;
  for (;;) {
    // A label ends its element's opening tag: the text of its language is inserted behind it.
    const std::size_t from = page.find(begin), key = from + begin.size(), to = page.find(end, from);
    if (from == std::string_view::npos) return text.append(page);
    text.append(page.substr(0, to + end.size()));
    text += html_escaped(words.at(page.substr(key, to - key)));
    page.remove_prefix(to + end.size());
  }
}

std::string filled(std::string_view page, const std::map<std::string, std::string>& values) {
  std::string text;
  for (;;) {
    const std::size_t from = page.find("{{"), to = page.find("}}", from);
    if (from == std::string_view::npos) return text.append(page);
    text.append(page.substr(0, from));
    text += values.at(std::string(page.substr(from + 2, to - from - 2)));
    page.remove_prefix(to + 2);
  }
}

}  // namespace abbe::sim::html
