# Writes the files of a folder as model_templates(). -DFILES=... (separated by |) -DOUTPUT=...
string(REPLACE "|" ";" FILES "${FILES}")
set(entries "")
foreach(file IN LISTS FILES)
  get_filename_component(name "${file}" NAME_WE)
  file(READ "${file}" text)
  string(APPEND entries "      {\"${name}\", R\"~~~(${text})~~~\"},\n")
endforeach()
file(WRITE "${OUTPUT}" "#include \"identify/model/templates.h\"

namespace identikal {

const std::vector<ModelTemplate>& model_templates() {
  static const std::vector<ModelTemplate> all{
${entries}  };
  return all;
}

}  // namespace identikal
")
