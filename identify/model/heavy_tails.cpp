#include "identify/model/heavy_tails.h"

#include "identify/model/internal/yaml_tree.h"
#include "lib/base/error.h"

namespace identikal {

YamlNode with_student_noise(YamlNode root) {
  const bool by_formulas = find(root, "dynamics") != nullptr || find(root, "components") != nullptr;
  const YamlNode* R = find(root, "R");
  if (by_formulas && R != nullptr) {
    throw InputError(R->at, "Student's t for a measurement noise given as R",
                     "noise: {measurement: {variance: {OUTPUT: ...}}} in a model of formulas");
  }
  YamlNode& measurement = value_at(value_at(root, "noise"), "measurement");
  if (find(measurement, "kind") != nullptr) {
    value_at(measurement, "kind") = yaml_scalar("student");
  } else {
    append(measurement, "kind", yaml_scalar("student"));
  }
  return root;
}

}  // namespace identikal
