# Writes the report page as a C++ string:
#   cmake -DSOURCE=identify/report/page -DUPLOT=.../uplot -DVERSIONS=JSON -DOUTPUT=report_template.cpp -P embed.cmake
file(READ ${SOURCE}/page.html page)
file(READ ${SOURCE}/page.css page_css)
file(READ ${SOURCE}/page.js page_js)
file(READ ${UPLOT}/dist/uPlot.min.css uplot_css)
file(READ ${UPLOT}/dist/uPlot.iife.min.js uplot_js)
file(READ ${UPLOT}/LICENSE uplot_licence)
foreach(part uplot.css page.css uplot.licence uplot.js page.js)
  string(REPLACE "." "_" variable ${part})
  string(REPLACE "{{${part}}}" "${${variable}}" page "${page}")
endforeach()
file(WRITE ${OUTPUT} "// Written by embed.cmake.
#include \"identify/report/page_template.h\"

namespace identikal {

std::string_view report_template() { return R\"~page~(${page})~page~\"; }

std::string_view report_versions() { return R\"~page~(${VERSIONS})~page~\"; }

}  // namespace identikal
")
