#include "lib/data/csv.h"

#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "lib/base/constants.h"
#include "tests/support/shared_data.h"

namespace identikal {
namespace {

using testing::ElementsAre;
using testing::ElementsAreArray;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// A file that lives as long as the object. Tests run side by side: the name holds the process.
class File {
 public:
  explicit File(const std::string& content)
      : path_(testing::TempDir() + "csv_test_" + std::to_string(getpid()) + ".csv") {
    std::ofstream(path_, std::ios::binary) << content;
  }
  ~File() { std::filesystem::remove(path_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

Table read(const std::string& content) {
  const File file(content);
  return read_csv(file.path());
}

// The message of the error that reading the file gives, with "F" for the path; "" without an error.
std::string message_of_file(const std::string& path) {
  try {
    read_csv(path);
  } catch (const InputError& error) {
    const std::string message = error.what();
    EXPECT_TRUE(message.starts_with(path)) << message;
    return "F" + message.substr(path.size());
  }
  return "";
}

std::string message_of(const std::string& content) {
  const File file(content);
  return message_of_file(file.path());
}

std::vector<std::string> units(const Table& table) {
  std::vector<std::string> out;
  for (const Column& column : table.columns) out.push_back(column.unit);
  return out;
}

testing::Matcher<std::vector<double>> values(const std::vector<double>& expected) {
  std::vector<testing::Matcher<double>> each;
  for (const double value : expected) {
    each.push_back(std::isnan(value) ? testing::Matcher<double>(testing::IsNan())
                                     : testing::Matcher<double>(value));
  }
  return ElementsAreArray(each);
}

// --- Header, units and separators ---

struct HeaderCase {
  const char* what;
  std::string content;
  char separator;
  std::vector<std::string> names;
  std::vector<std::string> units;
  std::vector<double> second;  // values of the second column
  std::vector<std::string> metadata = {};
};

TEST(Csv, KnowsTheFormsOfHeaderAndUnits) {
  const std::vector<HeaderCase> cases = {
      {"comma", "t,y\n0,1\n1,2\n", ',', {"t", "y"}, {"", ""}, {1, 2}},
      {"semicolon", "t;y\n0;1\n1;2\n", ';', {"t", "y"}, {"", ""}, {1, 2}},
      {"tab", "t\ty\n0\t1\n1\t2\n", '\t', {"t", "y"}, {"", ""}, {1, 2}},
      {"no line feed at the end", "t,y\n0,1\n1,2", ',', {"t", "y"}, {"", ""}, {1, 2}},
      {"CR LF", "t,y\r\n0,1\r\n1,2\r\n", ',', {"t", "y"}, {"", ""}, {1, 2}},
      {"CR LF, none at the end", "t,y\r\n0,1\r\n1,2", ',', {"t", "y"}, {"", ""}, {1, 2}},
      {"byte order mark", "\xEF\xBB\xBFt,y\n0,1\n1,2\n", ',', {"t", "y"}, {"", ""}, {1, 2}},
      {"one row", "t,y\n0,1\n", ',', {"t", "y"}, {"", ""}, {1}},
      {"blanks around cells", " t , y \n 0 ,\t1 \n 1, 2\n", ',', {"t", "y"}, {"", ""}, {1, 2}},
      {"square brackets", "t [s],v [km/h]\n0,1\n1,2\n", ',', {"t", "v"}, {"s", "km/h"}, {1, 2}},
      {"no blank", "t[s],v[km/h]\n0,1\n1,2\n", ',', {"t", "v"}, {"s", "km/h"}, {1, 2}},
      {"round brackets", "t(s),c(N/(rad s))\n0,1\n", ',', {"t", "c"}, {"s", "N/(rad s)"}, {1}},
      {"name, unit in quotes",
       "\"TIME, sec\";\"STEER, deg\"\n0;1\n1;2\n",
       ';',
       {"TIME", "STEER"},
       {"sec", "deg"},
       {1, 2}},
      {"name, unit in a comma file",
       "\"TIME, sec\",\"STEER, deg\"\n0,1\n1,2\n",
       ',',
       {"TIME", "STEER"},
       {"sec", "deg"},
       {1, 2}},
      {"unit row", "t;swa\ns;deg\n0;1\n1;2\n", ';', {"t", "swa"}, {"s", "deg"}, {1, 2}},
      {"unit row, brackets", "t;swa\n[s];[deg]\n0;1\n", ';', {"t", "swa"}, {"s", "deg"}, {1}},
      {"unit row with a 1",
       "t;mu;r\ns;1;deg/s\n0;1;2\n",
       ';',
       {"t", "mu", "r"},
       {"s", "1", "deg/s"},
       {1}},
      {"unit row with an unknown unit",
       "t,a,b,c\ns,deg,m/s,quux\n0,1,2,3\n",
       ',',
       {"t", "a", "b", "c"},
       {"s", "deg", "m/s", "quux"},
       {1}},
      {"unit row with an empty cell",
       "t,a,b\ns,,m\n0,1,2\n",
       ',',
       {"t", "a", "b"},
       {"s", "", "m"},
       {1}},
      {"letters that are units too", "t,s,m\n0,1,2\n", ',', {"t", "s", "m"}, {"", "", ""}, {1}},
      {"suffix is part of the name",
       "t,yaw_rate_rps\n0,1\n",
       ',',
       {"t", "yaw_rate_rps"},
       {"", ""},
       {1}},
      {"a bracket inside is not a unit",
       "t,v (x) raw\n0,1\n",
       ',',
       {"t", "v (x) raw"},
       {"", ""},
       {1}},
      {"Latin-1", "t,swa [\xB0]\n0,1\n", ',', {"t", "swa"}, {"", "\u00B0"}, {1}},
      {"UTF-8", "t,swa [\u00B0]\n0,1\n", ',', {"t", "swa"}, {"", "\u00B0"}, {1}},
      {"same name, other unit",
       "t,v [m/s],v [km/h]\n0,1,2\n",
       ',',
       {"t", "v [m/s]", "v [km/h]"},
       {"", "m/s", "km/h"},
       {1}},
      {"rows that are one quoted cell each",
       "\"t,\"\"v, m/s\"\",x\"\n\"0,1.5,2\"\n\"1,2.5,3\"\n",
       ',',
       {"t", "v", "x"},
       {"", "m/s", ""},
       {1.5, 2.5}},
      {"such rows of two cells", "\"y,u\"\n\"1,5\"\n\"2,6\"\n", ',', {"y", "u"}, {"", ""}, {5, 6}},
      {"such rows between semicolons",
       "\"y;u\"\n\"1,5;5\"\n\"2,5;6\"\n",
       ';',
       {"y", "u"},
       {"", ""},
       {5, 6}},
      {"quotes, separators and doubled quotes",
       "\"t, a\"\"b\",\"x;y\"\n\"0\",\"1\"\n\"1\",\"2\"\n",
       ',',
       {"t", "x;y"},
       {"a\"b", ""},
       {1, 2}},
      {"empty header cell", ",y\n0,1\n1,2\n", ',', {"column_1", "y"}, {"", ""}, {1, 2}},
      {"unnamed last column",
       "t,y,\n0,1,5\n1,2,6\n",
       ',',
       {"t", "y", "column_3"},
       {"", "", ""},
       {1, 2}},
      {"empty cells at the header's end",
       "t;y;   ;\n0;1\n1;2\n",
       ';',
       {"t", "y"},
       {"", ""},
       {1, 2}},
      {"separator at the rows' end", "t,y\n0,1,\n1,2,\n", ',', {"t", "y"}, {"", ""}, {1, 2}},
      {"separator at every end", "t;y;\n0;1;\n1;2;\n", ';', {"t", "y"}, {"", ""}, {1, 2}},
      {"empty cells up to the header's",
       "t,y,,\n0,1,,\n1,2,,\n",
       ',',
       {"t", "y"},
       {"", ""},
       {1, 2}},
      {"text column first",
       "run,t,y\na,0,1\nb,1,2\n",
       ',',
       {"run", "t", "y"},
       {"", "", ""},
       {0, 1}},
      {"header above missing cells",
       "t,y\nNA,\n0,1\n1,2\n",
       ',',
       {"t", "y"},
       {"", ""},
       {kNaN, 1, 2}},
  };
  for (const HeaderCase& c : cases) {
    SCOPED_TRACE(c.what);
    const Table table = read(c.content);
    EXPECT_EQ(table.separator, c.separator);
    EXPECT_TRUE(table.has_header);
    EXPECT_THAT(table.column_names(), ElementsAreArray(c.names));
    EXPECT_THAT(units(table), ElementsAreArray(c.units));
    ASSERT_GE(table.columns.size(), 2u);
    EXPECT_THAT(table.columns[1].values, values(c.second));
    EXPECT_EQ(table.rows, c.second.size());
    for (const Column& column : table.columns) EXPECT_EQ(column.values.size(), table.rows);
    EXPECT_THAT(table.metadata, IsEmpty());
  }
}

TEST(Csv, SkipsMetadataAndComments) {
  const std::vector<HeaderCase> cases = {
      {"a title", "A title\nt,y\n0,1\n", ',', {"t", "y"}, {"", ""}, {1}, {"A title"}},
      {"prose with commas",
       "By me, in May, at 5\nt,y\n0,1\n",
       ',',
       {"t", "y"},
       {"", ""},
       {1},
       {"By me, in May, at 5"}},
      {"names and values",
       "Vehicle;Octavia\nMass;1446\n\n12\nt;swa;r\ns;deg;deg/s\n0;1;2\n0,5;2;3\n",
       ';',
       {"t", "swa", "r"},
       {"s", "deg", "deg/s"},
       {1, 2},
       {"Vehicle;Octavia", "Mass;1446", "12"}},
      {"as wide as the rows",
       "Mass,1446\nt,y\n0,1\n1,2\n",
       ',',
       {"t", "y"},
       {"", ""},
       {1, 2},
       {"Mass,1446"}},
      {"a row of numbers", "3,4\nt,y\n0,1\n1,2\n", ',', {"t", "y"}, {"", ""}, {1, 2}, {"3,4"}},
      {"a quote that is not closed",
       "\"Tuesday\nt,y\n0,1\n",
       ',',
       {"t", "y"},
       {"", ""},
       {1},
       {"\"Tuesday"}},
      {"Latin-1",
       "Gr\xFC\xDF"
       "e\nt,y\n0,1\n",
       ',',
       {"t", "y"},
       {"", ""},
       {1},
       {"Grüße"}},
      {"comments anywhere",
       "# one\nt,y\n  # two\n0,1\n#three,3\n1,2\n# four",
       ',',
       {"t", "y"},
       {"", ""},
       {1, 2},
       {"# one", "# two", "#three,3", "# four"}},
      {"comment is the header", "# t (s), y\n0,1\n1,2\n", ',', {"t", "y"}, {"s", ""}, {1, 2}},
      {"comment is the header, after others",
       "# by me\n#t;y\n0;1\n",
       ';',
       {"t", "y"},
       {"", ""},
       {1},
       {"# by me"}},
      {"comments are header and units",
       "# t, v\n# s, m/s\n0,1\n",
       ',',
       {"t", "v"},
       {"s", "m/s"},
       {1}},
      {"comment below a header stays one",
       "t,y\n# a, b\n0,1\n",
       ',',
       {"t", "y"},
       {"", ""},
       {1},
       {"# a, b"}},
      {"number sign as a column name", "#,y\n0,1\n1,2\n", ',', {"column_1", "y"}, {"", ""}, {1, 2}},
  };
  for (const HeaderCase& c : cases) {
    SCOPED_TRACE(c.what);
    const Table table = read(c.content);
    EXPECT_TRUE(table.has_header);
    EXPECT_THAT(table.column_names(), ElementsAreArray(c.names));
    EXPECT_THAT(units(table), ElementsAreArray(c.units));
    ASSERT_GE(table.columns.size(), 2u);
    EXPECT_THAT(table.columns[1].values, values(c.second));
    EXPECT_THAT(table.metadata, ElementsAreArray(c.metadata));
  }
}

TEST(Csv, NamesColumnsByNumberWithoutAHeader) {
  const Table table = read("0,1,5\n1,2,6\n");
  EXPECT_FALSE(table.has_header);
  EXPECT_EQ(table.header_line, 0);
  EXPECT_THAT(table.column_names(), ElementsAre("column_1", "column_2", "column_3"));
  EXPECT_EQ(table.columns[2].header, "");
  EXPECT_THAT(table.columns[2].values, values({5, 6}));
  EXPECT_EQ(read("0,1,\n1,2,\n").columns.size(), 2u);
  EXPECT_THAT(read("Title\n0,1\n1,2\n").column_names(), ElementsAre("column_1", "column_2"));
  EXPECT_THAT(read("# remark\n0,1\n1,2\n").metadata, ElementsAre("# remark"));
  EXPECT_THAT(read("a,0,1\nb,1,2\n").column_names(),
              ElementsAre("column_1", "column_2", "column_3"));
}

TEST(Csv, ReadsASingleColumn) {
  const Table plain = read("1120\n1160\n\n963\n");
  EXPECT_FALSE(plain.has_header);
  EXPECT_THAT(plain.columns[0].values, values({1120, 1160, kNaN, 963}));  // empty = missing
  EXPECT_THAT(read("level [m]\n1\n2\n").column_names(), ElementsAre("level"));
  EXPECT_THAT(units(read("level\nm\n1\n2\n")), ElementsAre("m"));
  EXPECT_THAT(read("level\n1,\n2,\n").column_names(), ElementsAre("level"));
  EXPECT_THAT(read("# level\n1\n2\n").column_names(), ElementsAre("level"));
  EXPECT_THAT(read("# level [m]\n1\n2\n").column_names(), ElementsAre("level"));
  EXPECT_THAT(read("# measured at Aswan\n1\n2\n").column_names(), ElementsAre("column_1"));
}

TEST(Csv, RemembersWhereHeaderAndUnitsStand) {
  const Table table = read("Title\n\nt,v\ns,m/s\n0,1\n");
  EXPECT_EQ(table.header_line, 3);
  EXPECT_EQ(table.unit_line, 4);
  EXPECT_EQ(table.line_of_row(0), 5);
  EXPECT_EQ(read("t,v\n0,1\n").unit_line, 0);
}

TEST(Csv, FindsTheLineOfARow) {
  const Table table = read("t,y\n0,1\n1,1\n\n2,1\n# note\n# note\n3,1\n4,1\n");
  ASSERT_EQ(table.rows, 5u);
  EXPECT_EQ(table.line_of_row(0), 2);
  EXPECT_EQ(table.line_of_row(1), 3);
  EXPECT_EQ(table.line_of_row(2), 5);
  EXPECT_EQ(table.line_of_row(3), 8);
  EXPECT_EQ(table.line_of_row(4), 9);
  EXPECT_EQ(table.line_runs.size(), 3u);
}

TEST(Csv, FindsColumns) {
  const Table table = read("t,Speed [m/s],speed_2,a,A,3\n0,1,2,3,4,5\n");
  EXPECT_EQ(table.find("t"), &table.columns[0]);
  EXPECT_EQ(table.find("T"), &table.columns[0]);
  EXPECT_EQ(table.find("speed"), &table.columns[1]);
  EXPECT_EQ(table.find("Speed [m/s]"), &table.columns[1]);
  EXPECT_EQ(table.find("a"), &table.columns[3]);
  EXPECT_EQ(table.find("A"), &table.columns[4]);
  EXPECT_EQ(table.find("2"), &table.columns[1]);
  for (const char* name : {"0", "7", "-1", "1.0", "", "velocity", "99999999999999999999"}) {
    EXPECT_EQ(table.find(name), nullptr) << name;
  }
  const Table ambiguous = read("t,aX,Ax\n0,1,2\n");
  EXPECT_EQ(ambiguous.find("ax"), nullptr);
  EXPECT_EQ(read("t,2\nx,y\n0,1\n").find("nothing"), nullptr);
}

// --- Cells ---

struct CellCase {
  const char* cell;
  double value;
};

TEST(Csv, ReadsNumbers) {
  const std::vector<CellCase> cases = {
      {"0", 0.0},
      {"-0.000", -0.0},
      {"42", 42.0},
      {"+1.5", 1.5},
      {"-1.5", -1.5},
      {".5", 0.5},
      {"-.5", -0.5},
      {"5.", 5.0},
      {"1e3", 1000.0},
      {"1E+3", 1000.0},
      {"-1.25e-3", -1.25e-3},
      {"007.50", 7.5},
      {"0.1", 0.1},
      {"9007199254740993", 9007199254740992.0},
      {"0.30000000000000004", 0.30000000000000004},
      {"1692117187.46380758", 1692117187.46380758},
      {"123456789012345678901234567890", 123456789012345678901234567890.0},
      {"0.000000000000000000000000000001", 1e-30},
      {"4.9406564584124654e-324", 4.9406564584124654e-324},
      {"1e-400", 0.0},
      {"-1e-400", -0.0},
      {"1.7976931348623157e308", 1.7976931348623157e308},
      {"\"2.5\"", 2.5},
      {" \" 2.5 \" ", 2.5},
  };
  for (const CellCase& c : cases) {
    SCOPED_TRACE(c.cell);
    const Table table = read(std::string("t,x,y\n0,") + c.cell + ",1\n1," + c.cell + "\t,1\n");
    ASSERT_EQ(table.columns[1].values.size(), 2u);
    for (const double value : table.columns[1].values) {
      EXPECT_EQ(std::bit_cast<std::uint64_t>(value), std::bit_cast<std::uint64_t>(c.value));
    }
    EXPECT_EQ(table.columns[1].missing, 0u);
  }
}

TEST(Csv, KnowsMissingCells) {
  for (const char* cell :
       {"", "  ", "nan", "NaN", "NAN", "-nan", "NA", "n/a", "null", "NULL", "\"\"", "\"NA\""}) {
    SCOPED_TRACE(cell);
    const Table table = read(std::string("t,x,y\n0,1,2\n1,") + cell + ",3\n2,5," + cell + "\n");
    EXPECT_THAT(table.columns[1].values, values({1, kNaN, 5}));
    EXPECT_THAT(table.columns[2].values, values({2, 3, kNaN}));
    EXPECT_EQ(table.columns[1].missing, 1u);
    EXPECT_EQ(table.columns[1].text_cells, 0u);
  }
}

TEST(Csv, KeepsThePlaceOfTheFirstText) {
  for (const char* cell :
       {"abc", "inf", "-inf", "Infinity", "1e999", "1.2.3", "1,5",    "--1",        "+-1", "+",
        "-",   ".",   "1e",   "0x10",     "12 m",  "1 000", "nan(0)", "2024-05-29", "5\"", "."}) {
    SCOPED_TRACE(cell);
    const std::string written = std::string(cell).find(',') == std::string::npos
                                    ? std::string(cell)
                                    : "\"" + std::string(cell) + "\"";
    const Table table = read("t,x,y\n0,1,2\n1, " + written + ",3\n2," + written +
                             ",4\n3,6,5\n4,6,5\n5,6,5\n6,6,5\n");
    const Column& x = table.columns[1];
    EXPECT_THAT(x.values, values({1, kNaN, kNaN, 6, 6, 6, 6}));
    EXPECT_EQ(x.missing, 2u);
    EXPECT_EQ(x.text_cells, 2u);
    EXPECT_EQ(x.first_text.line, 3);
    EXPECT_EQ(x.first_text.column, 4);
    EXPECT_EQ(x.first_text.text, cell);
    EXPECT_EQ(table.columns[2].text_cells, 0u);
  }
}

TEST(Csv, CountsColumnsInCharactersAndCutsLongText) {
  const Table table =
      read("n,x\n\u00FC\u00DF,1\na,2\nb,\u00E9" + std::string(100, 'z') + "\nc,3\nd,4\ne,5\nf,6\n");
  EXPECT_EQ(table.columns[1].first_text.line, 4);
  EXPECT_EQ(table.columns[1].first_text.column, 3);
  EXPECT_EQ(table.columns[1].first_text.text, "\u00E9" + std::string(39, 'z') + "...");
  EXPECT_EQ(read("n,x,y\n\u00FC\u00DF,oops,3\na,2,3\nb,2,3\nc,2,3\n").columns[1].first_text.column,
            4);
}

TEST(Csv, ABadCellInTheFirstRowDoesNotMakeItAHeader) {
  const Table table = read("t,y\nabc,1\n1,2\n2,3\n");
  EXPECT_THAT(table.column_names(), ElementsAre("t", "y"));
  EXPECT_EQ(table.rows, 3u);
  EXPECT_EQ(table.columns[0].first_text.line, 2);
  // Without a header it is still a row, not metadata.
  const Table bare = read("abc,1\n1,2\n2,3\n");
  EXPECT_FALSE(bare.has_header);
  EXPECT_EQ(bare.rows, 3u);
  EXPECT_EQ(bare.columns[0].first_text.line, 1);
}

TEST(Csv, ARepeatedHeaderIsTextNotANewStart) {
  const Table table = read("t,y\n0,1\n1,2\nt,y\n0,1\n1,2\n2,3\n3,4\n4,5\n5,6\n");
  EXPECT_EQ(table.rows, 9u);
  EXPECT_EQ(table.columns[0].first_text.line, 4);
}

TEST(Csv, DetectsTheDecimalComma) {
  const Table semicolon = read("t;y\n0;1\n0,5;-2,25\n1;,5\n1,5;1e3\n2;1,5e-3\n");
  EXPECT_TRUE(semicolon.decimal_comma);
  EXPECT_THAT(semicolon.columns[0].values, values({0, 0.5, 1, 1.5, 2}));
  EXPECT_THAT(semicolon.columns[1].values, values({1, -2.25, 0.5, 1000, 1.5e-3}));
  const Table tab = read("t\ty\n0\t1,5\n1\t2,5\n");
  EXPECT_TRUE(tab.decimal_comma);
  EXPECT_THAT(tab.columns[1].values, values({1.5, 2.5}));
  EXPECT_FALSE(read("t;y\n0;1.5\n1;2.5\n").decimal_comma);
  EXPECT_FALSE(read("t;y\n0;1\n1;2\n").decimal_comma);
  EXPECT_FALSE(read("t,y\n0,1\n1,2\n").decimal_comma);
}

TEST(Csv, TheFirstFractionDecidesTheDecimalMark) {
  // "1.234" after a decimal comma may be a thousand: it is not read as either.
  const Table comma = read("t;y\n0,5;1\n1,5;1.234\n2,5;1.234,5\n3,5;7\n4,5;8\n5,5;9\n6,5;9\n");
  EXPECT_THAT(comma.columns[1].values, values({1, kNaN, kNaN, 7, 8, 9, 9}));
  EXPECT_EQ(comma.columns[1].first_text.text, "1.234");
  const Table point = read("t;y\n0.5;1\n1.5;1,5\n2.5;3\n3.5;4\n");
  EXPECT_THAT(point.columns[1].values, values({1, kNaN, 3, 4}));
}

// --- Errors ---

TEST(Csv, SaysWhatIsWrongWithAFile) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "F: the file is empty; expected a header line and rows of numbers"},
      {" \n\t\r\n\n", "F: the file is empty; expected a header line and rows of numbers"},
      {"\xEF\xBB\xBF", "F: the file is empty; expected a header line and rows of numbers"},
      {"t,y\n",
       "F:1: the file ends without a row of numbers; expected a header line and rows of numbers"},
      {"t,y\n\n# nothing\n",
       "F:3: the file ends without a row of numbers; expected a header line and rows of numbers"},
      {"t,y\n,\nNA,\n",
       "F:3: the file ends without a row of numbers; expected a header line and rows of numbers"},
      {"# only\n",
       "F:1: the file ends without a row of numbers; expected a header line and rows of numbers"},
      {"Dear Sir,\nthere are no numbers here.\n",
       "F:2: the file ends without a row of numbers; expected a header line and rows of numbers"},
      {"a,b,c,d,e\n1,2,3\n",
       "F:2:6: row has 3 cells, the header has 5; expected as many cells in each row; is the file "
       "cut off here?"},
      {"a,b,c,d,e\n1,2,3\n1,2,3,4,5\n1,2,3,4,5\n",
       "F:2:6: row has 3 cells, the header has 5; expected as many cells in each row"},
      {"a,b,c,d,e\n1,2,3\n1,2,3\n1,2,3\n",
       "F:2:6: row has 3 cells, the header has 5; expected as many cells in each row"},
      {"a,b\n1,2\n1, 2, 3\n1,2\n",
       "F:3:7: row has 3 cells, the header has 2; expected as many cells in each row"},
      {"a,b\n1,2\n1,2,,\n1,2\n",
       "F:3:5: row has 4 cells, the header has 2; expected as many cells in each row"},
      {"a,b\n1,2\n1,2,x\n1,2\n",
       "F:3:5: row has 3 cells, the header has 2; expected as many cells in each row"},
      {"a,b,c\n1,2,3\n1,\u00FC\n1,2,3\n1,2,3\n",
       "F:3:4: row has 2 cells, the header has 3; expected as many cells in each row"},
      {"1,2,3\n1,2,3,4,5\n1,2,3\n",
       "F:2:7: row has 5 cells, the first row has 3; expected as many cells in each row"},
      {"a,b\n1,2\n3\n4,5\n6,7\n",
       "F:3:2: row has 1 cell, the header has 2; expected as many cells in each row"},
      {"a,b\n1,2\n3,4\nx,y,z\n1,2,3\n1,2,3\n1,2,3\n1,2,3\n",
       "F:4:5: row has 3 cells, the header has 2; expected as many cells in each row"},
      {"t,v,t\n0,1,2\n",
       "F:1:5: column name 't' is a duplicate (columns 1 and 3); expected a different name for "
       "each column"},
      {"# t, v [m], v [m]\n0,1,2\n",
       "F:1:13: column name 'v [m]' is a duplicate (columns 2 and 3); expected a different name "
       "for each column"},
      {"t,y\n0,\"1\n1,2\n",
       "F:2:3: a quote that is not closed: '\"1'; expected a closing quote before the separator"},
      {"t,y\n0,\"1\"x\n1,2\n",
       "F:2:3: a quote that is not closed: '\"1\"x'; expected a closing quote before the "
       "separator"},
      {"t,\"y\n0,1\n1,2\n",
       "F:1:3: a quote that is not closed: '\"y'; expected a closing quote before the separator"},
      {std::string("t,y\n0,1\n1,\0"
                   "2\n",
                   12),
       "F:3:3: not a text file (byte 0x00); expected columns of numbers separated by comma, "
       "semicolon or tab"},
      {"t,y\n0,1\n1,\x1B[2m\n",
       "F:3:3: not a text file (byte 0x1B); expected columns of numbers separated by comma, "
       "semicolon or tab"},
      {std::string("\xFF\xFEt\0,\0y\0\n\0", 10),
       "F:1:4: not a text file (byte 0x00); expected columns of numbers separated by comma, "
       "semicolon or tab; "
       "this looks like UTF-16: save it as UTF-8"},
      {"t,y\r0,1\r1,2\r",
       "F:1:4: a carriage return without a line feed; expected lines that end in LF or CR LF"},
  };
  for (const auto& [content, message] : cases) {
    SCOPED_TRACE(content);
    EXPECT_EQ(message_of(content), message);
  }
}

TEST(Csv, SaysWhatIsWrongWithAPath) {
  EXPECT_EQ(message_of_file(testing::TempDir() + "no_such_recording.csv"),
            "F: cannot open the file: No such file or directory");
  EXPECT_EQ(message_of_file(testing::TempDir()),
            "F: this is a directory; expected a text file of columns");
  const File file("t,y\n0,1\n");
  std::filesystem::permissions(file.path(), std::filesystem::perms::none);
  // The superuser may read anything.
  if (geteuid() != 0) {
    EXPECT_EQ(message_of_file(file.path()), "F: cannot open the file: Permission denied");
  }
  if (std::filesystem::exists("/proc/self/mem")) {
    EXPECT_EQ(message_of_file("/proc/self/mem"), "F: cannot read the file: Input/output error");
  }
}

TEST(Csv, RefusesTooManyColumns) {
  std::string header = "c1", row = "1";
  for (int j = 2; j <= 100'000; ++j) {
    header += ",c" + std::to_string(j);
    row += ",1";
  }
  const std::string expected =
      ": more than 10000 columns; expected one row for each sample; is the table transposed?";
  EXPECT_EQ(message_of(header + "\n" + row + "\n" + row + "\n"), "F:1" + expected);
  EXPECT_EQ(message_of(row + "\n"), "F:1" + expected);
}

TEST(Csv, ReadsTenThousandColumns) {
  std::string row = "1";
  for (int j = 2; j <= 10'000; ++j) row += "," + std::to_string(j);
  const Table table = read(row + "\n" + row + "\n");
  ASSERT_EQ(table.columns.size(), 10'000u);
  EXPECT_THAT(table.columns.back().values, values({10'000, 10'000}));
}

TEST(Csv, QuotesLittleOfTheFileInAMessage) {
  const std::string longname(5000, 'q');
  EXPECT_LT(message_of(longname + "," + longname + "\n0,1\n").size(), 200u);
  EXPECT_LT(message_of("t,y\n0,\"" + longname + "\n1,2\n").size(), 200u);
  EXPECT_EQ(quoted_excerpt(longname), "'" + std::string(40, 'q') + "...'");
  EXPECT_EQ(quoted_excerpt("short"), "'short'");
}

TEST(Csv, RecognisesRandomBytes) {
  std::mt19937 engine(7);
  for (const std::size_t size : {200u, 5000u, 200'000u}) {
    std::string bytes(size, ' ');
    // Without a NUL, so that the control characters alone must tell.
    for (char& c : bytes) c = static_cast<char>(1 + engine() % 255);
    EXPECT_THAT(message_of(bytes), HasSubstr(": not a text file (byte 0x"));
  }
}

TEST(Csv, BlankLinesOfASingleColumnAreEmptyCells) {
  const Table one = read("y\n\n\n1\n2\n\n3.5\n1\n2\n\n");
  const Table two = read("y,z\n,\n,\n1,\n2,\n,\n3.5,\n1,\n2,\n,\n");
  EXPECT_EQ(one.rows, 9u);
  EXPECT_EQ(two.rows, 9u);
  for (std::size_t row = 0; row < one.rows; ++row) {
    const double value = one.columns[0].values[row], same = two.columns[0].values[row];
    EXPECT_TRUE(value == same || (std::isnan(value) && std::isnan(same))) << row;
    EXPECT_EQ(one.line_of_row(row), two.line_of_row(row)) << row;
  }
  EXPECT_EQ(one.columns[0].missing, 4u);
  EXPECT_EQ(read("y [m]\n# left\n\n1\n2\n").rows, 3u);
  EXPECT_EQ(read("1\n2\n\n").rows, 3u);
}

TEST(Csv, APercentSignBeginsACommentAsInMatlab) {
  const Table table =
      parse_csv("% made by a solver\n% t, y [m]\n0, 1\n% half way\n1, 2\n", "a.csv");
  EXPECT_THAT(table.column_names(), ElementsAre("t", "y"));
  EXPECT_EQ(table.columns[1].unit, "m");
  EXPECT_THAT(table.columns[1].values, ElementsAre(1.0, 2.0));
  EXPECT_THAT(table.metadata, ElementsAre("% made by a solver", "% half way"));
}

TEST(Csv, BlanksAloneMaySeparateColumns) {
  const Table table = parse_csv(
      "a simulated pendulum, at rest\n#  t   speed [km/h]  y\n   0.0  60.1  -1e-3\n   0.1  60.3  "
      "nan\n  10.2  60.5 "
      " "
      "2\r\n",
      "log.dat");
  EXPECT_TRUE(table.blanks);
  EXPECT_THAT(table.column_names(), ElementsAre("t", "speed", "y"));
  EXPECT_THAT(units(table), ElementsAre("", "km/h", ""));
  EXPECT_THAT(table.columns[0].values, ElementsAre(0.0, 0.1, 10.2));
  EXPECT_EQ(table.columns[2].values[0], -1e-3);
  EXPECT_EQ(table.columns[2].missing, 1u);
  const Table bare = parse_csv("  1,5 2,5\n 3,5  4,5\n", "log.dat");
  EXPECT_THAT(bare.columns[1].values, ElementsAre(2.5, 4.5));
}

// A date and its time of day are one cell, whether they have one name or two.
TEST(Csv, BlanksBetweenADateAndItsTimeSeparateNothing) {
  for (const char* header : {"date time y", "when y", "# when y"}) {
    const Table table = parse_csv(
        std::string(header) + "\n2024-01-31 12:00:00 1.5\n2024-01-31 12:00:10 1.6\n", "log.dat");
    ASSERT_EQ(table.columns.size(), 2u) << header;
    EXPECT_EQ(table.columns[0].dates, Dates::instants) << header;
    EXPECT_EQ(table.columns[0].values[1] - table.columns[0].values[0], 10.0) << header;
    EXPECT_EQ(table.columns[1].name, "y");
  }
}

TEST(Csv, BlanksSeparateNothingBesideASeparator) {
  EXPECT_THAT(parse_csv("a, b\n1, 2\n3, 4\n", "log.csv").columns[1].values, ElementsAre(2.0, 4.0));
  EXPECT_FALSE(parse_csv("a, b\n1, 2\n3, 4\n", "log.csv").blanks);
  const Table tabs = parse_csv("a\tb\tc\n1\t\t2\n3\t\t4\n", "log.csv");
  EXPECT_EQ(tabs.columns.size(), 3u);
  const Table dates = parse_csv("t,y\n2024-01-31 12:00:00,15\n2024-01-31 12:00:10,16\n", "log.csv");
  EXPECT_THAT(dates.columns[1].values, ElementsAre(15.0, 16.0));
}

TEST(Csv, ARaggedRowOfBlanksIsNamedAtItsPlace) {
  EXPECT_EQ(message_of("t  y\n0.0  1\n0.1  \n0.2  3\n0.3  4\n0.4  5\n0.5  6\n"),
            "F:3:4: row has 1 cell, the header has 2; expected as many cells in each row");
}

TEST(Csv, ManyBlankLinesNeedNoMemory) {
  std::string content =
      "a,b,c,d,e,f,g,h\n1,2,3,4,5,6,7,8\n" + std::string(100'000, '\n') + "1,2,3,4,5,6,7,8\n";
  const Table table = read(content);
  EXPECT_EQ(table.rows, 2u);
  EXPECT_EQ(table.line_of_row(1), 100'003);
  EXPECT_LT(table.columns[0].values.capacity(), 20'000u);
}

// --- Properties ---

TEST(Csv, RandomTablesReadBackBitForBit) {
  std::mt19937_64 engine(20240529);
  const auto chance = [&](unsigned one_in) { return engine() % one_in == 0; };
  for (int trial = 0; trial < 200; ++trial) {
    SCOPED_TRACE(trial);
    const char separator = std::string_view(",;\t")[engine() % 3];
    const bool header = !chance(4);
    const std::string end = chance(2) ? "\r\n" : "\n";
    const std::size_t columns = 1 + engine() % 12, rows = 2 + engine() % 60;
    const bool decimal_comma = columns > 1 && separator == ';' && chance(2);
    std::vector<std::vector<double>> truth(columns);
    std::string text;
    if (header) {
      for (std::size_t j = 0; j < columns; ++j) {
        text += (j > 0 ? std::string(1, separator) : "") + "name " + std::to_string(j) + " [rad/s]";
      }
      text += end;
    }
    for (std::size_t row = 0; row < rows; ++row) {
      if (row > 1 && chance(10)) {
        text += columns > 1 && chance(2) ? end : "# a comment, with; separators\t" + end;
      }
      for (std::size_t j = 0; j < columns; ++j) {
        if (j > 0) text += separator;
        if (row > 1 && chance(10)) {
          truth[j].push_back(kNaN);
          const bool can_be_empty = columns > 1 || row + 1 < rows;
          text += can_be_empty && chance(2) ? "" : "NaN";
          continue;
        }
        double value = 0.0;
        char cell[400];
        char* stop = cell;
        const auto style = engine() % 4;
        if (style == 0) {  // any double at all
          do {
            value = std::bit_cast<double>(engine());
          } while (!std::isfinite(value));
          stop = std::to_chars(cell, cell + sizeof cell, value).ptr;
        } else {  // what a logger writes, with few or many digits
          const double drawn = std::uniform_real_distribution<double>(-1000.0, 1000.0)(engine);
          stop = std::to_chars(cell, cell + sizeof cell, drawn,
                               style == 1 ? std::chars_format::fixed : std::chars_format::general,
                               static_cast<int>(engine() % 22))
                     .ptr;
          std::from_chars(cell, stop, value);
        }
        truth[j].push_back(value);
        std::string written(cell, stop);
        if (decimal_comma && written.find('.') != std::string::npos)
          written[written.find('.')] = ',';
        if (chance(15)) written = "\"" + written + "\"";
        text += (chance(6) ? " " : "") + written + (chance(6) ? "  " : "");
      }
      if (columns > 1 && chance(8)) text += separator;
      if (row + 1 < rows || chance(2)) text += end;
    }
    const Table table = read(text);
    ASSERT_EQ(table.columns.size(), columns) << text;
    ASSERT_EQ(table.rows, rows) << text;
    EXPECT_EQ(table.has_header, header);
    for (std::size_t j = 0; j < columns; ++j) {
      EXPECT_EQ(table.columns[j].text_cells, 0u);
      EXPECT_EQ(table.columns[j].unit, header ? "rad/s" : "");
      for (std::size_t row = 0; row < rows; ++row) {
        const double read_value = table.columns[j].values[row], value = truth[j][row];
        if (std::isnan(value)) {
          EXPECT_TRUE(std::isnan(read_value));
        } else {
          EXPECT_EQ(std::bit_cast<std::uint64_t>(read_value), std::bit_cast<std::uint64_t>(value));
        }
      }
    }
  }
}

TEST(Csv, DamagedFilesAreReadOrRefusedNeverWorse) {
  const std::string whole =
      "Title; here\n\"t, s\";v [m/s];r(deg/s)\n0;1,5;\"2\"\n1;NA;3\n# c\n2;7;8\n3;x;1e3\n";
  std::mt19937 engine(1);
  int refused = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    std::string damaged = whole;
    for (unsigned edits = 1 + engine() % 6; edits > 0 && !damaged.empty(); --edits) {
      const std::size_t at = engine() % damaged.size();
      const char byte =
          engine() % 2 == 0 ? ";,\t\"\n\r#. 0"[engine() % 10] : static_cast<char>(engine() % 256);
      switch (engine() % 4) {
        case 0:
          damaged[at] = byte;
          break;
        case 1:
          damaged.insert(at, 1, byte);
          break;
        case 2:
          damaged.erase(at, 1 + engine() % 9);
          break;
        default:
          damaged.resize(at);
      }
    }
    const File file(damaged);
    try {
      const Table table = read_csv(file.path());
      for (const Column& column : table.columns) ASSERT_EQ(column.values.size(), table.rows);
      ASSERT_GT(table.line_of_row(table.rows - 1), 0);
    } catch (const InputError& error) {
      ++refused;
      ASSERT_THAT(error.what(), Not(HasSubstr("\n")));
      ASSERT_LT(std::string(error.what()).size(), 400u);
    }
  }
  EXPECT_GT(refused, 100);
}

// --- Recordings as others write them ---

struct RecordingCase {
  const char* file;
  std::vector<std::string> names;
  std::vector<std::string> units;  // empty: none has a unit
  std::size_t rows;
  double first, last;  // first and last value of the column `probe`
  std::size_t probe = 0;
};

TEST(Csv, ReadsTheReferenceRecordings) {
  IDENTIKAL_NEEDS_SHARED_FILE("recordings/README.md");
  const std::vector<RecordingCase> cases = {
      {"recordings/revs_250lm_first_half.csv",
       {"t", "delta", "deltaFL", "deltaFR", "vx", "vy", "beta_true", "yawRate", "yawRateFilt",
        "ayCG", "ayCGFilt", "axCG", "yawAngAcc", "yawAngAccFilt"},
       {},
       27501,
       149.99,
       424.99},
      {"recordings/stanford_me227_ab.csv",
       {"t", "deltaMeasured_rad", "deltaCommand_rad", "Ux_mps", "Uy_mps", "r_radps", "ax_mps2",
        "ay_mps2", "FxCommand_N", "s_m", "e_m", "deltaPsi", "controllerSelected"},
       {},
       11831,
       0.0,
       59.14743},
      {"recordings/polaris_steady_circle_summary.csv",
       {"run", "swa_nom", "v_wheel", "v_ins", "yaw_rate_rps_raw", "ay_mps2_raw", "sd_yaw_rate",
        "sd_v", "T"},
       {},
       35,
       180.0,
       -90.0,
       1},
      {"recordings/polaris_circle_timeseries.csv",
       {"run", "t", "swa_cmd_rad", "yaw_rate_rps", "ay_mps2", "yaw_rad", "v_wheel_mps",
        "v_ins_mps"},
       {},
       42038,
       0.3,
       37.68,
       1},
      {"recordings/polaris_human_connor_track3_1.csv",
       {"t", "swa_rad", "vx_mps", "vy_mps", "yaw_rate_rps", "ay_mps2", "v_wheel_mps"},
       {},
       3497,
       0.0,
       69.92},
      {"recordings/revsted_obd_sample.csv",
       {"INS_time_sec", "LatAcc_obd", "brake_pressure_obd", "speedo_obd", "SW_pos_obd", "VelFR_obd",
        "VelFL_obd", "VelRR_obd", "VelRL_obd", "yaw_rate",
        "Correvit_slip_angle_COG_corrvittiltcorrected", "INSTimestamp_ADMA"},
       {},
       999,
       1716990839.85,
       1716990859.81},
      {"recordings/cobb_sim_marc1.txt",
       {"TIME", "SPEED", "YAWVEL"},
       {"sec", "kph", "deg/sec"},
       3301,
       0.0,
       33.0},
      {"recordings/cobb_sim_marc2.txt",
       {"TIME", "SPEED", "STEER", "YAWVEL"},
       {"sec", "kph", "deg", "deg/sec"},
       4097,
       0.0,
       40.96},
      {"recordings/cobb_sim_marc3.txt",
       {"TIME", "LATACC", "RUN", "SIDSLP", "SPEED", "STEER", "YAWVEL"},
       {"sec", "g", "RUN", "deg", "kph", "deg", "deg/sec"},
       17017,
       0.0,
       10.0},
      {"recordings/cobb_sim_marc4.txt",
       {"TIME", "LATACC", "SIDSLP", "SPEED", "STEER"},
       {"sec", "g", "deg", "kph", "deg"},
       1201,
       0.0,
       12.0},
      {"recordings/comma2k19_rav4_steer.csv",
       {"t", "steering_wheel_deg"},
       {},
       4974,
       -0.004544,
       59.982706},
      {"recordings/comma2k19_rav4_speed.csv",
       {"t", "speed_mps", "w_fl", "w_fr", "w_rl", "w_rr"},
       {},
       4974,
       0.0,
       59.988114},
      {"recordings/comma2k19_rav4_imu.csv",
       {"t", "gyro_fwd", "gyro_right", "gyro_down", "acc_fwd", "acc_right", "acc_down"},
       {},
       6256,
       -0.009469,
       59.982418},
      {"recordings/iac_av21_Putnam_park2023_run4_2.csv",
       {"time", "x", "y", "vx", "vy", "phi", "delta", "omega", "ax", "deltadelta", "wheel_fl",
        "wheel_fr", "wheel_rl", "wheel_rr", "roll", "throttle_ped_cmd", "brake_ped_cmd"},
       {"s", "m", "m", "m/s", "m/s", "rad", "rad", "rad/s", "m/s^2", "rad/s", "kmph", "kmph",
        "kmph", "kmph", "rad", "%", "kPa"},
       11900,
       1692117187.46380758,
       1692117663.42335367},
      {"likelihood/nile.csv", {"year", "y"}, {}, 100, 1871, 1970},
      {"likelihood/sys1.csv", {"column_1"}, {}, 1000, 0.66932513245236702, 1.5807417506745596},
      {"likelihood/sys6.csv",
       {"column_1", "column_2"},
       {},
       3000,
       -1.505213250676849,
       -0.11738184272820507},
      {"likelihood/sys7.csv",
       {"column_1", "column_2"},
       {},
       3000,
       1.6588605763148041,
       1.1430313857310961,
       1},
  };
  for (const RecordingCase& c : cases) {
    SCOPED_TRACE(c.file);
    const Table table = read_csv(shared_file(c.file));
    EXPECT_THAT(table.column_names(), ElementsAreArray(c.names));
    std::vector<std::string> none;
    for (const Column& column : table.columns)
      none.push_back(column.dates == Dates::none ? "" : "s");
    EXPECT_THAT(units(table), ElementsAreArray(c.units.empty() ? none : c.units));
    ASSERT_EQ(table.rows, c.rows);
    EXPECT_EQ(table.columns[c.probe].values.front(), c.first);
    EXPECT_EQ(table.columns[c.probe].values.back(), c.last);
    for (const Column& column : table.columns) {
      EXPECT_EQ(column.missing, column.name == "run" ? table.rows : 0u) << column.name;
      EXPECT_EQ(column.dates != Dates::none, column.name == "INSTimestamp_ADMA") << column.name;
    }
  }
}

}  // namespace
}  // namespace identikal
