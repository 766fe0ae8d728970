# Writes the report page as a C++ string:
#   cmake -DSOURCE=identify/report/page -DVERSIONS=JSON -DOUTPUT=report_template.cpp -P embed.cmake
file(READ ${SOURCE}/page.html page)
file(READ ${SOURCE}/page.css page_css)
# One script, in this order: what draws, what there is to show, the sections, the page.
set(page_js "")
foreach(part text chart time_plot blocks summary parameters signals whiteness vehicle handling curves black_box likelihood recordings page)
  file(READ ${SOURCE}/${part}.js script)
  string(APPEND page_js "${script}\n")
endforeach()
string(REPLACE "{{page.css}}" "${page_css}" page "${page}")
string(REPLACE "{{page.js}}" "${page_js}" page "${page}")
file(WRITE ${OUTPUT} "// Written by embed.cmake.
#include \"identify/report/page_template.h\"

namespace identikal {

std::string_view report_template() { return R\"~page~(${page})~page~\"; }

std::string_view report_versions() { return R\"~page~(${VERSIONS})~page~\"; }

}  // namespace identikal
")
