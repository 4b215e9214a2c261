// SPDX-License-Identifier: MIT
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>

#include "identify/log/filled.hpp"
#include "identify/log/log.hpp"
#include "identify/log/masks.hpp"
#include "identify/log/units.hpp"
#include "tests/identify/says.hpp"
#include "wire/pc/user_error.hpp"

namespace {

using identify::ColumnMap;
using identify::Log;
using identify::Role;
using tests::says;
using wire::pc::UserError;

std::string file(const std::string& text) {
  const std::string path = (std::filesystem::temp_directory_path() / "log.csv").string();
  std::ofstream(path, std::ios::binary) << text;
  return path;
}

std::vector<Log> read(const std::string& text, const ColumnMap& map = {}) {
  return identify::logs_of(identify::read_table(file(text)), map, std::nullopt);
}

std::string complaint(const std::string& text, const ColumnMap& map = {}, int code = 3) {
  try {
    read(text, map);
  } catch (const UserError& error) {
    EXPECT_EQ(error.exit_code(), code);
    const std::string sentence = error.what();
    EXPECT_EQ(sentence.find('\n'), std::string::npos);
    return sentence;
  }
  ADD_FAILURE() << "read without a complaint";
  return "";
}

const std::string head = "time_s,current_A,housing_degC\n";

TEST(Reader, OwnColumnNamesNeedNoMap) {
  const auto logs = read(head + "0,1,20\n0.1,2,21\n");
  ASSERT_EQ(logs.size(), 1u);
  EXPECT_DOUBLE_EQ(logs[0].of(Role::current)[1], 2);
  EXPECT_DOUBLE_EQ(logs[0].of(Role::housing)[1], 21);
}

TEST(Map, EachThatComesAlongIsReadAndTheOneOfSessionsTellsThePeriod) {
  int read = 0;
  for (const auto& map : std::filesystem::directory_iterator(HOTCORE_SOURCE_DIR "/identify/maps")) {
    EXPECT_FALSE(identify::read_map(map.path()).columns.empty()) << map.path();
    ++read;
  }
  EXPECT_GE(read, 3);
  EXPECT_EQ(identify::read_map(HOTCORE_SOURCE_DIR "/identify/maps/paderborn_sessions.toml").period_s, 0.5);
  const std::string path = (std::filesystem::temp_directory_path() / "spoilt.toml").string();
  for (const auto& [line, why] :
       {std::pair("period_s = -1", "seconds from row to row"), std::pair("averaged = 1", "write true or false")}) {
    std::ofstream(path) << line << "\n[columns]\nhousing_degC = \"T\"\n";
    try {
      identify::read_map(path);
      ADD_FAILURE() << line << " was read";
    } catch (const UserError& error) {
      says(error.what(), why);
    }
  }
  std::ofstream(path) << "averaged = true\n[columns]\nhousing_degC = \"T\"\n";
  EXPECT_TRUE(identify::read_map(path).averaged);
}

TEST(Map, ThatSaysSoReadsARowsLoadAsAllThatFlowedBeforeIt) {
  ColumnMap map;
  map.averaged = true;
  const Log log = read("time_s,current_A,housing_degC\n0,1,20\n1,2,21\n2,3,22\n", map)[0];
  EXPECT_TRUE(log.averaged);
  EXPECT_EQ(log.of(Role::current), (std::vector<double>{2, 3, 3}));
  EXPECT_EQ(log.of(Role::housing), (std::vector<double>{20, 21, 22}));
  says(log.notes.back(), "since the row before it: it was said that they are averaged");
}

TEST(Map, OfVescToolReadsItsLog) {
  // A part of its columns; each line ends in a separator, and a day within the log.
  ColumnMap map = identify::read_map(HOTCORE_SOURCE_DIR "/identify/maps/vesc.toml");
  add_column(map, "speed_rad_per_s=erpm:0.1429rpm");
  const Log log = read(
      "ms_today;input_voltage;temp_mos_max;temp_motor;current_motor;current_in;d_axis_current;q_axis_current;erpm;\n"
      "86399900;24.0;25.0;24.5;-2.5;0.3;0.01;-2.5;-700;\n0;24.0;26.0;24.6;3.0;0.4;0.01;3.0;7000;\n",
      map)[0];
  EXPECT_NEAR(log.of(Role::time)[1], 0.1, 1e-9);
  EXPECT_EQ(log.of(Role::iq), (std::vector<double>{-2.5, 3}));
  EXPECT_EQ(log.of(Role::housing)[1], 24.6);
  EXPECT_NEAR(log.of(Role::speed)[1], 1000.3 * M_PI / 30, 1e-9);
}

TEST(Reader, RowsWithoutATimeFollowEachOtherByThePeriodThatIsSaidInEachSession) {
  ColumnMap map;
  map.period_s = 0.5;
  const std::string rows = "current_A,housing_degC,session\n1,20,7\n1,20,7\n2,30,8\n2,31,8\n2,32,8\n";
  const auto logs = read(rows, map);
  ASSERT_EQ(logs.size(), 2u);
  EXPECT_EQ(logs[0].of(Role::time), (std::vector<double>{0, 0.5}));
  EXPECT_EQ(logs[1].of(Role::time), (std::vector<double>{0, 0.5, 1}));
  EXPECT_EQ(logs[1].of(Role::housing), (std::vector<double>{30, 31, 32}));
  says(complaint(rows), "--period S");
  says(complaint(head + "0,1,20\n1,1,20\n", map, 2), "its column 'time_s' tells the time");
}

TEST(Reader, SemicolonsDecimalCommasQuotesCrlfAndByteOrderMarkAreUnderstood) {
  const auto logs =
      read("\xEF\xBB\xBF# logger 3\r\n\"time_s\";\"current_A\";housing_degC\r\n0;1,5;20,25\r\n0,5;-2;\"21,5\"\r\n");
  EXPECT_DOUBLE_EQ(logs[0].of(Role::current)[0], 1.5);
  EXPECT_DOUBLE_EQ(logs[0].of(Role::time)[1], 0.5);
  EXPECT_DOUBLE_EQ(logs[0].of(Role::housing)[1], 21.5);
}

TEST(Reader, WhatLabViewWritesAboveItsTableIsPassedOver) {
  const std::string above =
      "LabVIEW Measurement\t\nSeparator\tTab\nDate\t2026/11/21\n***End_of_Header***\t\n\t\n"
      "Channels\t2\t\t\nY_Unit_Label\tAmps\tDeg C\t\nDelta_X\t1.0\t1.0\t\n***End_of_Header***\t\t\t\n"
      "X_Value\tcurrent_A\thousing_degC\tComment\n";
  ColumnMap map;
  identify::add_column(map, "time_s=X_Value");
  const auto logs = read(above + "0.0\t1.0\t20.5\t\n1.0\t2.0\t21.5\t\n", map);
  EXPECT_EQ(logs[0].of(Role::current), (std::vector<double>{1, 2}));
  EXPECT_EQ(logs[0].of(Role::housing), (std::vector<double>{20.5, 21.5}));
  says(complaint(above + "0.0\t1.0\t20.5\t\n1.0\t2.0\n", map), "line 12");
}

TEST(Reader, TabsAreUnderstood) {
  EXPECT_DOUBLE_EQ(read("time_s\tcurrent_A\thousing_degC\n0\t1\t20\n1\t2\t21\n")[0].of(Role::housing)[1], 21);
}

TEST(Reader, BlanksSeparateWhatNothingElseDoes) {
  for (const char* text : {"time_s current_A housing_degC\n0 1 20\n1 2 21\n",
                           "A title of three\n\n time_s  current_A   housing_degC\n 0  1 20 \n 1  2 21 \r\n",
                           "# time_s current_A housing_degC\n0.0e+00 1.0e+00 2.0e+01\n1.0e+00 2.0e+00 2.1e+01\n"}) {
    const auto logs = read(text);
    ASSERT_EQ(logs[0].of(Role::time).size(), 2u) << text;
    EXPECT_DOUBLE_EQ(logs[0].of(Role::current)[1], 2);
    EXPECT_DOUBLE_EQ(logs[0].of(Role::housing)[1], 21);
  }
  says(complaint("time_s current_A housing_degC\n0 1 20\n1 2\n"), "line 3: the row has 2 of 3 cells");
}

TEST(Reader, AHeaderBehindAHashIsAHeader) {
  const auto logs = read("# logger 3\n# time_s,current_A,housing_degC\n0,1,20\n1,2,21\n");
  ASSERT_EQ(logs[0].of(Role::time).size(), 2u);
  EXPECT_DOUBLE_EQ(logs[0].of(Role::current)[1], 2);
  says(complaint("# logger 3\n0,1,20\n"), "where the header should be");
  says(complaint("# 0,1,19\n0,1,20\n"), "where the header should be");
}

TEST(Reader, ARowOfUnitsBelowTheHeaderIsObeyedUnlessTheColumnsUnitWasSaid) {
  const std::string text = "time_s,iq_A,T\nms,[A],°F\n0,1,50\n1500,2,212\n";
  ColumnMap map;
  add_column(map, "housing_degC=T");
  const auto logs = read(text, map);
  EXPECT_DOUBLE_EQ(logs[0].of(Role::time)[1], 1.5);
  EXPECT_DOUBLE_EQ(logs[0].of(Role::iq)[1], 2);
  EXPECT_NEAR(logs[0].of(Role::housing)[1], 100, 1e-9);
  says(logs[0].notes.front(), "Units are taken from the table: time_s in ms, housing_degC in °F.");
  ColumnMap said;
  add_column(said, "housing_degC=T:degC");
  EXPECT_DOUBLE_EQ(read(text, said)[0].of(Role::housing)[0], 50);
  says(complaint("time_s,current_A,housing_degC\ns,Arms,degC\n0,1,20\n"), "unknown unit 'Arms'");
}

TEST(Reader, HowADateIsWrittenIsNoUnit) {
  for (const char* format : {"dd.MM.yyyy HH:mm:ss", "TS", "[hh:mm:ss]"}) {
    const std::string text = std::string("time_s;current_A;housing_degC\n") + format +
                             ";mA;degC\n21.11.2026 10:00:00;1000;20\n21.11.2026 10:00:01;2000;21\n";
    const auto logs = read(text);
    EXPECT_EQ(logs[0].of(Role::time), (std::vector<double>{0, 1})) << format;
    EXPECT_EQ(logs[0].of(Role::current)[1], 2) << format;
  }
}

TEST(Reader, DegreesInLatin1AreDegrees) {
  ColumnMap map;
  add_column(map, "housing_degC=Gehäuse [°F]");
  const auto logs = read(
      "time_s;current_A;Geh\xE4use [\xB0"
      "F]\n0;1;50\n1;2;212\n",
      map);
  EXPECT_NEAR(logs[0].of(Role::housing)[1], 100, 1e-9);
}

TEST(Reader, Utf16InEitherOrderOfBytesIsRead) {
  ColumnMap map;
  add_column(map, "housing_degC=Gehäuse °F \U0001F321");
  std::u16string text = u"time_s;current_A;Gehäuse °F \U0001F321\r\n0;1;50\r\n1;2;212\r\n";
  for (const bool low_first : {true, false}) {
    std::string bytes = low_first ? "\xFF\xFE" : "\xFE\xFF";
    for (const char16_t unit : text) {
      const char high = static_cast<char>(unit >> 8), low = static_cast<char>(unit & 0xFF);
      bytes += {low_first ? low : high, low_first ? high : low};
    }
    EXPECT_DOUBLE_EQ(read(bytes, map)[0].of(Role::housing)[1], 212);
  }
}

TEST(Reader, AUnitInAMappedColumnsNameIsObeyedUnlessOneWasSaid) {
  const std::string rows = "\n0,1000,50,60\n1500,2000,212,60\n";
  const std::string text = "Time (ms),Current [mA],T_body degF,n (rpm)" + rows;
  ColumnMap map;
  for (const char* column :
       {"time_s=Time (ms)", "current_A=Current [mA]", "housing_degC=T_body degF", "speed_rad_per_s=n (rpm)"})
    add_column(map, column);
  const Log log = read(text, map)[0];
  EXPECT_DOUBLE_EQ(log.of(Role::time)[1], 1.5);
  EXPECT_DOUBLE_EQ(log.of(Role::current)[1], 2);
  EXPECT_NEAR(log.of(Role::housing)[1], 100, 1e-9);
  EXPECT_NEAR(log.of(Role::speed)[0], 6.283185307, 1e-9);
  says(
      log.notes.front(),
      "Units are taken from the columns' names: time_s in ms, current_A in mA, speed_rad_per_s in rpm, housing_degC in "
      "degF.");
  map.columns.erase(Role::time);
  add_column(map, "time_s=Time (ms):s");
  EXPECT_DOUBLE_EQ(read(text, map)[0].of(Role::time)[1], 1500);
  const Log rowed = read("Time (ms),Current [mA],T_body degF,n (rpm)\ns,,," + rows, map)[0];
  EXPECT_DOUBLE_EQ(rowed.of(Role::current)[1], 2) << "a row of units that says nothing of it";
}

TEST(Reader, AnOwnNameInAnotherUnitIsKnownByItsName) {
  const Log log = read("time_ms,current_mA,housing_degF,speed_rpm\n0,1000,50,60\n1500,2000,212,60\n")[0];
  EXPECT_DOUBLE_EQ(log.of(Role::time)[1], 1.5);
  EXPECT_DOUBLE_EQ(log.of(Role::current)[1], 2);
  EXPECT_NEAR(log.of(Role::housing)[1], 100, 1e-9);
  EXPECT_NEAR(log.of(Role::speed)[0], 6.283185307, 1e-9);
  says(log.notes.front(), "current_A in mA");
  const Log small = read("time_s,current_ma,housing_deg_f,speed_rad_s\n0,1000,50,60\n1,2000,212,60\n")[0];
  EXPECT_DOUBLE_EQ(small.of(Role::current)[1], 2);
  EXPECT_NEAR(small.of(Role::housing)[1], 100, 1e-9);
  EXPECT_EQ(small.of(Role::speed)[0], 60);
  EXPECT_DOUBLE_EQ(read("time_s,current_A,current_mA,housing_degC\n0,1,7,20\n1,2,7,21\n")[0].of(Role::current)[1], 2);
  const Log twice = read("time_s [s],current_A [A],housing_degC (°C),speed_rpm [rpm]\n0,1,20,60\n2,2,21,60\n")[0];
  EXPECT_EQ(twice.of(Role::time)[1], 2);
  EXPECT_EQ(twice.of(Role::current)[1], 2);
  EXPECT_EQ(twice.of(Role::housing)[1], 21);
  EXPECT_NEAR(twice.of(Role::speed)[0], 2 * M_PI, 1e-9);
  says(complaint("time_s,current_mA,current_kA,housing_degC\n0,1,7,20\n"),
       "columns 'current_mA' and 'current_kA' may both be current_A");
}

TEST(Reader, ANamesEndThatIsNoUnitOfTheRoleIsIgnored) {
  for (const char* column : {"T_K", "motor_F", "case F", "core_k", "T_min", "T_ms", "T (min)", "T [case]", "TdegF",
                             "K)", "(F) case", "T_degC", "T (C)", "degF_old"}) {
    ColumnMap map;
    add_column(map, std::string("housing_degC=") + column);
    const Log log = read("time_s,current_A," + std::string(column) + "\n0,1,20\n1,2,21\n", map)[0];
    EXPECT_DOUBLE_EQ(log.of(Role::housing)[1], 21) << column;
    EXPECT_TRUE(log.notes.empty()) << column;
  }
}

TEST(Reader, ANameThatIsAUnitOrEndsInOneTellsIt) {
  const auto read_as = [](Role role, const std::string& column) {
    ColumnMap map;
    add_column(map, identify::own_name(role) + "=" + column);
    std::string names = column, first = "0", second = "60";
    for (const Role other : {Role::time, Role::current, Role::housing}) {
      if (other != role) names += "," + identify::own_name(other), first += ",20", second += ",21";
    }
    return read(names + "\n" + first + "\n" + second + "\n", map)[0].of(role)[1];
  };
  for (const char* rpm : {"RPM", "MotorRPM", "motorRpm", "n/rpm", "esc.rpm", "n/1/min"})
    EXPECT_NEAR(read_as(Role::speed, rpm), 60 * 0.104719755, 1e-6) << rpm;
  EXPECT_NEAR(read_as(Role::time, "TimeUS"), 60e-6, 1e-12);
  EXPECT_NEAR(read_as(Role::time, "elapsedMs"), 0.06, 1e-12);
  EXPECT_NEAR(read_as(Role::time, "t/min"), 3600, 1e-9);
  EXPECT_NEAR(read_as(Role::current, "I/mA"), 0.06, 1e-12);
  for (const char* degF : {"T/F", "Case (\u2109)"}) EXPECT_NEAR(read_as(Role::housing, degF), 15.5555556, 1e-6) << degF;
}

TEST(Reader, ASpeedWhoseUnitNobodyTellsIsSaidToBeReadInRadians) {
  const auto notes = [](const std::string& column) {
    ColumnMap map;
    add_column(map, "speed_rad_per_s=" + column);
    const auto log = read("time_s,current_A,housing_degC,velocity\n0,1,20,60\n1,2,21,60\n", map)[0];
    return fmt::format("{}", fmt::join(log.notes, " "));
  };
  says(notes("velocity"), "No unit of column 'velocity' is known; it is read in rad/s. Say --column speed_rad_per_s=");
  EXPECT_EQ(notes("velocity:rad/s").find("No unit"), std::string::npos);
}

TEST(Reader, OfEffectiveValuesItIsSaidWhatTheyHeat) {
  const auto notes = [](const char* role, const std::string& column) {
    ColumnMap map;
    add_column(map, std::string(role) + "=" + column);
    const auto log = read("time_s," + column + ",housing_degC\n0,1,20\n1,2,21\n", map)[0];
    return fmt::format("{}", fmt::join(log.notes, " "));
  };
  says(notes("current_A", "I [Arms]"), "say --column current_A=\"I [Arms]:1.2247A\"");
  says(notes("iq_A", "Iq_rms"), "say --column iq_A=Iq_rms:1.4142A");
  says(notes("current_A", "I [\u2030]"), "The unit '\u2030' of column 'I [\u2030]' is not known and not used");
}

TEST(Reader, NegativeNumbersThatLostTheirSignHaveItAgain) {
  const auto current = [](const std::vector<const char*>& cells) {
    ColumnMap map;
    add_column(map, "current_A=present_current:10mA");
    std::string text = "time_s,housing_degC,present_current\n";
    for (std::size_t i = 0; i < cells.size(); ++i) text += fmt::format("{},20,{}\n", i, cells[i]);
    return read(text, map)[0];
  };
  const Log log = current({"0", "500", "65535", "65036", "7"});
  EXPECT_EQ(log.of(Role::current), (std::vector<double>{0, 5, -0.01, -5, 0.07}));
  says(log.notes.at(0), "Column 'present_current' shows negative numbers without their sign, 65535 for -1; read so.");
  EXPECT_EQ(current({"0", "4294967196", "4294967295"}).of(Role::current), (std::vector<double>{0, -1, -0.01}));
  const auto large = [&](const std::vector<const char*>& cells) { return current(cells).of(Role::current)[1]; };
  EXPECT_DOUBLE_EQ(large({"0", "65530", "40000", "50000"}), 655.3) << "numbers between: these are large";
  EXPECT_DOUBLE_EQ(large({"0", "60000", "52000", "0"}), 600)
      << "and so are these, though none is between: none is near zero";
  EXPECT_DOUBLE_EQ(large({"0", "65535.5", "3", "4"}), 655.355) << "no register";
  // 65535 alone is what says that nothing was read.
  says(complaint("time_s,housing_degC,current_A\n0,20,1\n1,20,65535\n2,20,65535\n"), "reaches 65535 A");
}

TEST(Reader, CommasThatSetThousandsApartAreNoDecimalCommas) {
  const auto table = [](const char* format, double step) {
    std::string text = "time_s\tcurrent_A\thousing_degC\tspeed_rpm\n";
    for (int i = 0; i < 50; ++i) {
      std::string cell = fmt::format(fmt::runtime(format), i * step);
      text += fmt::format("{}\t{}\t20\t{}\n", i, i % 3, cell);
    }
    return text;
  };
  std::string thousands = table("{:.0f}", 77);
  for (int i = 13; i < 50; ++i) {
    const std::string plain = fmt::format("\t{}\n", i * 77);
    thousands.replace(thousands.find(plain), plain.size(), fmt::format("\t{},{:03}\n", i * 77 / 1000, i * 77 % 1000));
  }
  says(complaint(thousands), "the commas of column 'speed_rpm' set thousands apart; export it without them");
  std::string decimals = table("{:.3f}", 0.077);
  for (std::size_t at = 0; (at = decimals.find('.', at)) != std::string::npos;) decimals[at] = ',';
  EXPECT_NEAR(read(decimals)[0].of(Role::speed)[20], 1.54 * 0.104719755, 1e-9);
  std::string three = "time_s;current_A;housing_degC\n";
  for (int i = 0; i < 50; ++i) three += fmt::format("{};{};24,{:03}\n", i, i % 3, 20 * i);
  EXPECT_EQ(read(three)[0].of(Role::housing)[1], 24.02);
}

TEST(Reader, ThousandsThatAreSetApartBesideDecimalsAreNoNumbersAndSaidToBeThat) {
  for (const char* cell : {"\"1,000.25\"", "1'000.25", "1\u00a0000.25", "1\u202f000.25"})
    says(complaint(head + "999,1,20\n" + cell + ",1,20\n"), "for it sets thousands apart; export the column without");
  says(complaint("time_s;current_A;housing_degC\n999,5;1;20\n1.000,25;1;20\n"), "sets thousands apart");
  for (const char* cell : {"1.5x", "1.000.25", "'"})
    EXPECT_EQ(complaint(head + "999,1,20\n\"" + cell + "\",1,20\n").find("thousands"), std::string::npos) << cell;
}

TEST(Reader, OfTwoHeaderRowsTheLowerOneNamesTheColumns) {
  const std::string groups = "Motor,Motor,Temperature,Temperature\n", rows = "0,1,20,21\n1,2,22,23\n";
  const Log log = read(groups + "time_s,current_A,housing_degC,core_degC\n" + rows)[0];
  EXPECT_EQ(log.of(Role::core)[1], 23);
  EXPECT_EQ(read(groups + "time_s,current_mA,housing_degC,core_degC\ns,mA,degF,degC\n" + rows)[0].of(Role::current)[1],
            0.002);
  says(complaint("time_s,current_A,housing_degC,housing_degC\ns,A,degC,degC\n" + rows), "stands there twice");
}

TEST(Reader, CommasInNumbersAndBetweenCellsAreAnsweredWithAnotherSeparator) {
  says(complaint(head + "0,1,5,20\n1,2,5,21\n"), "has 4 of 3 cells; if commas stand in its numbers as well, export it");
  says(complaint(head + "0,\"1,5\",20\n1,\"2,5\",21\n"),
       "'1,5' in column 'current_A' is not a number, for a comma in it is read only where");
  says(complaint("\"time_s,current_A,housing_degC\"\n\"0,1,20\"\n"), "the whole line is one cell, in quotes");
}

TEST(Reader, StrokesSeparateCells) {
  EXPECT_EQ(read("time_s | current_A | housing_degC\n0 | 1,5 | 20\n1 | 2,5 | 21\n")[0].of(Role::current)[1], 2.5);
}

TEST(Reader, APointerInPlaceOfTheLogIsSaidToBeOne) {
  says(complaint("version https://git-lfs.github.com/spec/v1\noid sha256:0f\nsize 12345\n"), "git lfs pull");
}

TEST(Reader, QuotesInQuotesAndASignSetApartAreUnderstood) {
  const auto logs = read(
      "time_s,current_A,housing_degC\n\"\"\"2022-10-26T08:00:00Z\"\"\",-   1.5,+  20.5\n"
      "\"\"\"2022-10-26T08:00:02Z\"\"\",-  12,-   1\n");
  EXPECT_EQ(logs[0].of(Role::time), (std::vector<double>{0, 2}));
  EXPECT_EQ(logs[0].of(Role::current), (std::vector<double>{-1.5, -12}));
  EXPECT_EQ(logs[0].of(Role::housing), (std::vector<double>{20.5, -1}));
}

TEST(Reader, ARoomIsToldOnceForAllRowsWhereNoColumnTellsIt) {
  ColumnMap map;
  map.ambient_degC = 22;
  EXPECT_EQ(read(head + "0,1,40\n1,2,41\n", map)[0].of(Role::ambient), (std::vector<double>{22, 22}));
  const auto cooled = read("time_s,current_A,housing_degC,coolant_degC\n0,1,20,20\n1,1,20,20\n", map);
  EXPECT_FALSE(cooled[0].has(Role::ambient));
  says(cooled[0].notes.at(0), "own coolant_degC tells how warm the surroundings are; --ambient is not used");
}

TEST(Reader, AHousingThatAFrameMovesMoreThanItsWindingIsNoSwappedColumn) {
  std::string text = "time_s,current_A,housing_degC,core_degC\n";
  for (int i = 0; i < 60; ++i) {  // a quarter more than the winding, with the load
    const bool warm = i % 4 < 2;
    text += fmt::format("{},{},{},{}\n", 30 * i, warm ? 2 : 0, warm ? 25 : 20, warm ? 25 : 21);
  }
  EXPECT_TRUE(read(text)[0].has(Role::core));
}

TEST(Reader, ASensorThatReadsNothingButZeroIsLeftOut) {
  const Log log = read("time_s,current_A,housing_degC,ambient_degC\n0,1,20,0\n1,2,21,0\n2,2,22,0\n")[0];
  EXPECT_FALSE(log.has(Role::ambient));
  says(log.notes[0], "ambient_degC is 0 in all rows, as of a sensor that is not connected, and was left out.");
}

TEST(Reader, ASensorThatReadsNothingButMinusOneIsLeftOut) {
  const auto logs = read("time_s,current_A,housing_degC,ambient_degC\n0,1,20,-1\n1,2,21,-1\n");
  EXPECT_FALSE(logs[0].has(Role::ambient));
  says(fmt::format("{}", fmt::join(logs[0].notes, " ")), "ambient_degC is -1 in all rows, as of a sensor that is not");
  EXPECT_TRUE(read("time_s,current_A,housing_degC,ambient_degC\n0,1,20,0\n1,2,21,\n2,2,21,9\n")[0].has(Role::ambient));
}

TEST(Reader, ASensorThatIsOpenIsLeftOutAndIfItIsTheOnlyOneSaidToBe) {
  // As VESC tells a motor without a thermistor.
  const std::string rows = "0,1,-75.2,20\n1,2,-74.1,21\n2,2,-76,22\n";
  const Log log = read("time_s,current_A,housing_degC,core_degC\n" + rows)[0];
  EXPECT_FALSE(log.has(Role::housing));
  EXPECT_TRUE(log.has(Role::core));
  says(log.notes.at(0),
       "housing_degC is below -45 in all rows, as of a sensor that is not connected, and was left out.");
  ColumnMap map;
  add_column(map, "housing_degC=temp_motor");
  says(complaint("time_s,current_A,temp_motor,temp_mos\n" + rows, map),
       "column 'temp_motor' is below -45 in all rows, as of a sensor that is not connected; connect it and record the "
       "log again, or map another as housing_degC.");
  says(complaint(head + "0,1,0\n1,2,0\n"), "column 'housing_degC' is 0 in all rows, as of a sensor that is not");
  EXPECT_TRUE(read(head + "0,1,-75\n1,2,-40\n")[0].has(Role::housing));
}

TEST(Reader, AMeterThatReadsNothingButZeroDoesNotHideAnother) {
  const auto power = read("time_s,current_A,power_W,housing_degC\n0,1,0,20\n1,2,0,21\n")[0];
  EXPECT_FALSE(power.has(Role::power));
  EXPECT_EQ(identify::heat_of(power), Role::current);
  says(fmt::format("{}", fmt::join(power.notes, " ")), "power_W is 0 in all rows, beside current_A, and was left out");
  EXPECT_EQ(identify::heat_of(read("time_s,current_A,iq_A,housing_degC\n0,0,1,20\n1,0,2,21\n")[0]), Role::iq);
  EXPECT_TRUE(read(head + "0,0,20\n1,0,21\n")[0].has(Role::current));
}

TEST(Reader, ASensorThatIsNotUpAtFirstHasReadNothing) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 0.2);
  std::string text = head;
  for (int i = 0; i < 300; ++i) text += fmt::format("{},1,{:.2f}\n", 0.1 * i, i < 40 ? 0 : 22 + noise(random));
  const Log log = read(text)[0];
  EXPECT_TRUE(std::isnan(log.of(Role::housing)[0]));
  says(log.notes[0], "housing_degC stood frozen at one value in 1 stretch (40 rows");
  EXPECT_EQ(log.notes[0].find("reaches no further"), std::string::npos);
}

TEST(Reader, ASensorThatStandsAtTheHighestItTellsIsSaidTo) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 0.2);
  std::string text = head;
  for (int i = 0; i < 900; ++i)
    text += fmt::format("{},1,{:.2f}\n", 0.1 * i, std::min(60.0, 50 + 20 * std::sin(0.01 * i) + noise(random)));
  says(read(text)[0].notes[0], ", 60, the highest that it tells, as where a sensor or an input reaches no further");
}

TEST(Reader, AUnitInBracketsThatIsNotKnownIsSaidNotToBeUsed) {
  const auto speed = [](const std::string& column) {
    ColumnMap map;
    add_column(map, "speed_rad_per_s=" + column);
    return read("time_s,current_A,housing_degC," + column + "\n0,1,20,60\n1,2,21,60\n", map)[0];
  };
  for (const char* rpm : {"n [U/min]", "n (1/min)", "n [min^-1]", "n [r/min]"})
    EXPECT_NEAR(speed(rpm).of(Role::speed)[1], 2 * std::numbers::pi, 1e-12) << rpm;
  const Log log = speed("n [Umdr./min]");
  EXPECT_EQ(log.of(Role::speed)[1], 60);
  ASSERT_EQ(log.notes.size(), 1u);
  says(log.notes[0], "The unit 'Umdr./min' of column 'n [Umdr./min]' is not known and not used; say --column");
}

TEST(Reader, OneColumnIsNotTwoThings) {
  ColumnMap map;
  add_column(map, "core_degC=T");
  add_column(map, "housing_degC=T");
  says(complaint("time_s,current_A,T\n0,1,20\n1,2,21\n", map), "column 'T' cannot be both core_degC and housing_degC");
}

TEST(Reader, DecimalCommasAreReadWhereNoCommaSeparates) {
  for (const char separator : {';', '\t'}) {
    std::string text = "time_s,current_A,housing_degC\n0|0,10,1|0,20|0\n0|5,1|5,20|5\n";
    std::replace(text.begin(), text.end(), ',', separator);
    std::replace(text.begin(), text.end(), '|', ',');
    if (separator == '\t') text.replace(text.find("\t1,0"), 4, "");
    if (separator == ';') text.replace(text.find(";1,0"), 4, "");
    const Log log = read(text)[0];
    EXPECT_EQ(log.of(Role::time)[1], 0.5);
    EXPECT_EQ(log.of(Role::housing)[1], 20.5);
  }
}

TEST(Reader, AFewRowsThatOvertookEachOtherAreSortedAndAClockThatWasSetIsNot) {
  std::string text = head, set = head;
  for (int i = 0; i < 60; ++i) {
    text += fmt::format("{},1,{}\n", i == 20 ? 21 : i == 21 ? 20 : i, i == 20 ? 21 : i == 21 ? 20 : i);
    set += fmt::format("{},1,20\n", i < 30 ? i : i - 3);
  }
  const Log log = read(text)[0];
  for (std::size_t i = 0; i < 60; ++i) EXPECT_EQ(log.of(Role::housing)[i], static_cast<double>(i));
  says(log.notes[0], "Rows that were out of order by a few were sorted by time: 1.");
  says(complaint(set), "time runs backwards from 29 to 27 s (a clock that was set");
}

TEST(Reader, RowsThatShareAWholeSecondAreSpreadOverIt) {
  std::string text = head;  // begins 0.4 s into a second
  for (int i = 4; i < 95; ++i) text += fmt::format("{},1,{}\n", 100 + i / 10, i);
  const Log log = read(text)[0];
  for (std::size_t i = 0; i < 90; ++i) EXPECT_NEAR(log.of(Role::time)[i], 0.1 * static_cast<double>(i), 1e-9) << i;
  says(log.notes[0], "About 10 rows share each time; they are spread over the 1 s to the next.");
}

TEST(Reader, TwoRowsASecondAreSpreadWhereSomeAreMissing) {
  std::string text = head;
  for (int i = 0; i < 20; ++i) text += i == 7 ? "" : fmt::format("{},{},{}\n", i / 2, i, 20 + i);
  const Log log = read(text)[0];
  EXPECT_DOUBLE_EQ(log.of(Role::time)[1], 0.5);
  EXPECT_DOUBLE_EQ(log.of(Role::time)[18], 9.5);
}

TEST(Reader, RowsInBurstsAreNotTakenForRowsThatAreMissing) {
  const auto period_s = [](auto time_of) {
    std::vector<double> t;
    for (int i = 0; i < 400; ++i) t.push_back(time_of(i));
    return identify::row_period_s(t);
  };
  EXPECT_NEAR(period_s([](int i) { return 0.1 * (i / 4) + 0.001 * (i % 4); }), 0.025, 1e-9) << "four messages";
  EXPECT_NEAR(period_s([](int i) { return 0.1 * i + 0.03 * (i % 2); }), 0.1, 1e-9) << "two of them";
  EXPECT_NEAR(period_s([](int i) { return 0.5 * (i / 5) + 0.002 * (i % 5); }), 0.1, 1e-9) << "stamped as received";
  std::mt19937 random(1);
  int row = 0;
  EXPECT_NEAR(period_s([&](int) { return 0.1 * (row += random() % 3 == 0 ? 2 : 1); }), 0.1, 1e-9)
      << "a quarter missing";
}

TEST(Reader, TimesAsIso8601WritesThemAreUnderstood) {
  const auto time_s = [](const std::string& from, const std::string& to) {
    return read(head + from + ",1,20\n" + to + ",2,21\n")[0].of(Role::time)[1];
  };
  EXPECT_NEAR(time_s("2025-12-31T23:59:59.5", "2026-01-01T00:00:01"), 1.5, 1e-6);
  EXPECT_NEAR(time_s("2024-02-28 12:00:00Z", "2024-03-01 12:00:00Z"), 2 * 86400, 1e-6) << "a leap year";
  EXPECT_NEAR(time_s("2025-06-01T10:00:00+02:00", "2025-06-01T08:00:30Z"), 30, 1e-6);
  EXPECT_NEAR(time_s("2025-06-01 10:00:00 +0200", "2025-06-01 08:00:30 Z"), 30, 1e-6);
  EXPECT_NEAR(time_s("09:59:58", "10:00:00.25"), 2.25, 1e-9);
  EXPECT_NEAR(time_s("2025-12-31 23:59:59 UTC", "2026-01-01 00:00:01+00:00"), 2, 1e-6);
  EXPECT_NEAR(time_s("31.12.2025 23:59:59.5", "31-Dec-2025 23:59:59.7"), 0.2, 1e-6);
  EXPECT_NEAR(time_s("0.1 sec", "0.25 sec"), 0.15, 1e-9);
  EXPECT_NEAR(time_s("23:59:60.5", "24:00:01"), 0.5, 1e-9) << "a leap second";
  for (const char* not_a_time : {"2025-13-01T00:00:00", "2025-06-31T00:00:00", "10:00", "noon", "2025-06-01", "1:61.0",
                                 "1:-5.0", "10:00:61", "10:00:-5"})
    says(complaint(head + not_a_time + ",1,20\n"), "is not a number");
}

TEST(Reader, ADateInAnotherFormIsAnsweredWithTheFormsThatAreRead) {
  const std::string forms =
      " is not a number, nor a time as it is read (12.5, 08:15:30, 1:05.3, 2026-11-21 08:15:30, "
      "2026-11-21T08:15:30.5+01:00, 21.11.2026 08:15:30, 21-Nov-2026 08:15:30, 11/21/2026 08:15:30 AM; "
      "--period S does without); repair it";
  for (const char* date : {"31.12.2025", "31.13.2025 10:00:00", "31-Foo-2025 10:00:00", "13/31/2025 10:00:00",
                           "13.5:00 AM", "8:15 PM", "2025-06-01", "Dec 31 10:00:00 2025"})
    says(complaint(head + date + ",1,20\n"), forms);
  for (const char* time :
       {"12.5", "08:15:30", "1:05.3", "08:15:30 AM", "2026-11-21 08:15:30", "2026-11-21T08:15:30.5+01:00",
        "21.11.2026 08:15:30", "21-Nov-2026 08:15:30", "11/21/2026 08:15:30 AM"})
    EXPECT_EQ(read(head + time + ",1,20\n")[0].of(Role::time).size(), 1u) << time;
  says(complaint(head + "1.5x,1,20\n"), "'1.5x' in column 'time_s' is not a number; repair it");
}

TEST(Reader, ATwentiethOfTheRowsLostAtRandomIsSaidAndJitterIsNone) {
  std::mt19937 random(1);
  const auto notes = [&](const std::function<double(int)>& time_s, unsigned kept_of_20) {
    std::string rows = head;
    for (int i = 0; i < 2000; ++i) {
      if (random() % 20 < kept_of_20) rows += fmt::format("{:.3f},1,{}\n", time_s(i), 20 + 0.01 * i);
    }
    return fmt::format("{}", fmt::join(read(rows)[0].notes, " "));
  };
  const auto steady = [](int i) { return 0.5 * i; };
  const auto jittering = [&](int i) { return 0.5 * i + 0.4 * static_cast<double>(random() % 1000) / 1000; };
  const char* lost = "of the rows are missing among the others";
  says(notes(steady, 19), "About 5 % of the rows are missing among the others (0.5 s apart)");
  EXPECT_EQ(notes(steady, 20).find(lost), std::string::npos);
  EXPECT_EQ(notes(jittering, 20).find(lost), std::string::npos);
}

TEST(Reader, ACountSince1970InNoSecondsIsRefusedWithItsUnit) {
  const auto rows = [](const std::string& zeros) {
    return head + "1764000000" + zeros + ",1,20\n1764000002" + zeros + ",2,21\n";
  };
  EXPECT_NEAR(read(rows(""))[0].of(Role::time)[1], 2, 1e-6);
  for (const auto& [zeros, unit] : {std::pair("000", "ms"), std::pair("000000", "us"), std::pair("000000000", "ns")}) {
    says(complaint(rows(zeros)), std::string("looks like ") + unit + " since 1970; say --column time_s=time_s:" + unit);
    ColumnMap map;
    add_column(map, std::string("time_s=time_s:") + unit);
    EXPECT_NEAR(read(rows(zeros), map)[0].of(Role::time)[1], 2, 1e-6);
  }
  ColumnMap still_too_coarse;
  add_column(still_too_coarse, "time_s=time_s:ms");
  says(complaint(rows("000000000"), still_too_coarse), "time_s=time_s:ns");
}

TEST(Reader, AClockThatPassesMidnightGoesOn) {
  const Log log = read(head + "23:59:59,1,20\n00:00:01,1,20\n23:00:00,1,20\n00:00:02,2,21\n")[0];
  EXPECT_NEAR(log.of(Role::time)[1], 2, 1e-9);
  EXPECT_NEAR(log.of(Role::time)[3], 86403, 1e-9);
  ASSERT_FALSE(log.notes.empty());
  says(log.notes[0], "passes midnight 2 times");
  says(complaint(head + "23:59:58,1,20\n00:00:00,1,20\n23:59:59,1,20\n00:00:01,1,20\n"), "time runs backwards");
  says(complaint(head + "10:00:00,1,20\n09:00:00,1,20\n"), "time runs backwards");
  says(complaint(head + "86399,1,20\n1,1,20\n"), "time runs backwards");
}

TEST(Reader, MillisecondsOfADayPassMidnight) {
  // As VESC's ms_today.
  ColumnMap map;
  add_column(map, "time_s=ms_today:ms");
  const auto logs = read("ms_today,current_A,housing_degC\n86399000,1,20\n86399500,1,20\n0,1,21\n500,1,21\n", map);
  EXPECT_EQ(logs[0].of(Role::time), (std::vector<double>{0, 0.5, 1, 1.5}));
  says(fmt::format("{}", fmt::join(logs[0].notes, " ")), "passes midnight 1 time");
  says(complaint(head + "86399,1,20\n86399.5,1,20\n0,1,21\n0.5,1,21\n"), "two recordings joined");
  says(complaint("ms_today,current_A,housing_degC\n5000000,1,20\n6000000,1,20\n0,1,21\n500,1,21\n", map),
       "two recordings joined");
}

TEST(Reader, AClockThatWouldRunForYearsIsAskedForItsUnit) {
  // As PX4's timestamp, in microseconds since it was switched on.
  says(complaint("timestamp,current_A,housing_degC\n12345678,1,20\n1212345678,1,21\n"),
       "it would last 13889 days, as no recording does; say in what its time counts, --column time_s=timestamp:us");
}

TEST(Reader, ARowWrittenTwiceCountsOnce) {
  const Log log = read(head + "0,1,20\n1,1,20\n1,1,20\n1,1,20\n1,1,21\n2,1,21\n")[0];
  EXPECT_EQ(log.of(Role::time).size(), 4u);
  ASSERT_FALSE(log.notes.empty());
  says(log.notes[0], "Rows that are the same as the row before were left out: 2.");
}

TEST(Reader, AnEmptyFirstOrLastCellBetweenTabsIsACell) {
  const identify::Table table =
      identify::read_table(file("note\ttime_s\tcurrent_A\tcore_degC\n\t0\t1\t\n\t1\t2\t20\n"));
  EXPECT_EQ(table.names.size(), 4u);
  EXPECT_EQ(table.rows(), 2u);
}

TEST(Reader, RowsOfEmptyCellsBeforeTheHeaderAreSkipped) {
  const Log log = read(",,,,\n\"\",\"\" ,\n \n" + head + "0,1,20\n1,2,21\n")[0];
  EXPECT_DOUBLE_EQ(log.of(Role::current)[1], 2);
  says(complaint(",,\n" + head + "0,1,20\n1,oops,20\n"), "line 4: ");
}

TEST(Reader, ALineEndInAQuotedCellIsPartOfIt) {
  ColumnMap map;
  add_column(map, "time_s=Time (ms)");
  const std::string text =
      "\"Time\n(ms)\",\"a \"\"note\"\"\r\nof it\",current_A,housing_degC\n0,\"x,\ny\",1,20\n1000,z,2,";
  const Log log = read(text + "21\n", map)[0];
  ASSERT_EQ(log.of(Role::time).size(), 2u);
  EXPECT_DOUBLE_EQ(log.of(Role::time)[1], 1);
  EXPECT_DOUBLE_EQ(log.of(Role::current)[1], 2);
  says(complaint(text + "oops\n", map), "line 6: 'oops'");
  says(complaint(text + "\"no\nnumber\"", map), "line 6: 'no number' in column 'housing_degC'");
}

TEST(Reader, AQuoteThatIsNotClosedIsRefusedWithItsLine) {
  std::string rows = "0,\"1,20\n";
  for (int i = 1; i < 200000; ++i) rows += std::to_string(i) + ",1,20\n";
  says(complaint(head + rows), "line 2: the row has 1 of 3 cells");
  says(complaint(head + "0,1,\"20\n1,1,20\n2,1,\"20\n"),
       "line 2: the row has 3 of 3 cells, one of them in quotes until line 4");
  EXPECT_EQ(read("time_s,current_A,housing_degC,tap 5\"\n0,1,20,\n1,2,21,\n")[0].of(Role::time).size(), 2u);
}

TEST(Reader, JsonIsRefusedWithWhatToWriteInstead) {
  for (const char* json :
       {"{\"time_s\": [0, 1]}\n", "\n[\n {\"time_s\": 0},\n {}]", "[[0,1,20],[1,1,20]]", "[\"a\"]", "{"})
    says(complaint(json), "this is JSON; write it as CSV: a line of column names");
  EXPECT_EQ(read("[Data]\n" + head + "0,1,20\n1,2,21\n")[0].of(Role::time).size(), 2u);
}

TEST(Reader, BlanksAroundANameInAMapAreNoPartOfIt) {
  ColumnMap map;
  add_column(map, " time_s = t one :ms ");
  add_column(map, "housing_degC= body ");
  EXPECT_DOUBLE_EQ(read(" t one ,current_A, body\n0,1,20\n500,2,21\n", map)[0].of(Role::time)[1], 0.5);
}

TEST(Reader, TextBehindAQuoteIsNotDropped) {
  says(complaint(head + "\"1\"5,1,20\n"), "line 2");
  EXPECT_DOUBLE_EQ(read(head + "\"1.5\" ,1,20\n\"2\",1,21\n")[0].of(Role::time)[1], 0.5);
}

TEST(Reader, ATrailingSeparatorInTheHeaderMakesNoColumn) {
  EXPECT_EQ(identify::read_table(file("time_s;current_A;housing_degC;\n0;1;20;\n")).names.size(), 3u);
}

TEST(Reader, TorqueCurrentAloneIsAHeatAndSaysSo) {
  const Log log = read("time_s,iq_A,housing_degC\n0,1,20\n1,2,21\n2,2,22\n")[0];
  ASSERT_FALSE(log.notes.empty());
  says(log.notes[0], "all current is taken to make torque");
}

TEST(Reader, UnitsOfMappedColumnsBecomeSi) {
  ColumnMap map;
  identify::add_column(map, "time_s=ms:ms");
  identify::add_column(map, "speed_rad_per_s=n:rpm");
  identify::add_column(map, "housing_degC=TF:degF");
  identify::add_column(map, "current_A=I:mA");
  const Log log = read("ms,n,TF,I\n0,60,68,1000\n500,60,212,2000\n", map)[0];
  EXPECT_DOUBLE_EQ(log.of(Role::time)[1], 0.5);
  EXPECT_NEAR(log.of(Role::speed)[0], 6.283185307, 1e-9);
  EXPECT_NEAR(log.of(Role::housing)[0], 20, 1e-9);
  EXPECT_NEAR(log.of(Role::housing)[1], 100, 1e-9);
  EXPECT_DOUBLE_EQ(log.of(Role::current)[1], 2);
}

/// Rows of two motors in turn, one of them warmer.
std::string two_motors(const std::string& column, const char* one, const char* other) {
  std::string text = "time_s,current_A,housing_degC," + column + "\n";
  for (int i = 0; i < 40; ++i)
    text +=
        fmt::format("{},{},{},{}\n", i / 2, i % 2 ? 3 : 1, i % 2 ? 50 + 0.1 * i : 20 + 0.1 * i, i % 2 ? one : other);
  return text;
}

TEST(Rows, ATemperatureOfAMotorIsNoNameOfOne) {
  std::string text = "time_s,current_A,housing_degC,motor FET temp\n";
  for (int i = 0; i < 15; ++i) text += fmt::format("{},{},{},{}\n", i, i % 3, 20 + 0.1 * i, 25 + 0.01 * i);
  EXPECT_EQ(read(text)[0].of(Role::time).size(), 15u);
}

TEST(Rows, OfSeveralMotorsAreRefusedAndThoseOfOneAreRead) {
  const std::string text = two_motors("motor", "left", "right");
  says(complaint(text),
       "its rows belong to several motors in turn, as column 'motor' tells (left, right); choose one "
       "with --rows \"motor=left\".");
  says(complaint(two_motors("nr", "1", "2")), "as column 'nr' tells (1, 2)");  // whose temperatures are far apart
  ColumnMap map;
  map.rows = "motor=left";
  const Log log = read(text, map)[0];
  ASSERT_EQ(log.of(Role::time).size(), 20u);
  EXPECT_DOUBLE_EQ(log.of(Role::current)[5], 3);
  EXPECT_DOUBLE_EQ(log.of(Role::housing)[5], 51.1);
  map.rows = "nr=2";
  EXPECT_DOUBLE_EQ(read(two_motors("nr", "1", "2"), map)[0].of(Role::current)[5], 1);
  map.rows = "motor=both";
  says(complaint(text, map, 2), "--rows motor=both: no row says so; its column says: right, left.");
  map.rows = "moter=left";
  says(complaint(text, map, 2), "has no column 'moter', did you mean 'motor'?");
  map.rows = "left";
  says(complaint(text, map, 2), "write it as COLUMN=VALUE");
  ColumnMap sessions;
  add_column(sessions, "session=motor");
  says(complaint(text, sessions), "its rows belong to several motors in turn");
}

TEST(Rows, OfMotorsOneAfterTheOtherOrOfAWholeRobotAreRefusedAsWell) {
  std::string blocks = "time_s,joint,current_A,housing_degC\n", robot = blocks;
  for (const char* joint : {"hip", "knee"}) {
    for (int i = 0; i < 10; ++i) blocks += fmt::format("{},{},{},{}\n", i, joint, i % 3, 20 + i);
  }
  says(complaint(blocks),
       "several motors one after the other, as column 'joint' tells (hip, knee); choose one with --rows \"joint=hip\"");
  ColumnMap map;
  add_column(map, "session=joint");
  EXPECT_EQ(read(blocks, map).size(), 2u);
  for (int i = 0; i < 29 * 6; ++i) robot += fmt::format("{},{},{},{}\n", i / 29, i % 29, i % 3, 20 + i % 29);
  says(complaint(robot), "several motors in turn, as column 'joint' tells (0, 1, 10");
}

TEST(Rows, WhatAMotorDidInOneRowBeforeTheClockBeganIsNoNameOfOne) {
  // As a thrust stand's summary above its table.
  std::string text = "time_s,current_A,housing_degC,Motor Efficiency (%)\n0.07,1,20,30.6\n";
  for (int i = 0; i < 30; ++i) text += fmt::format("{},{},{},32.4\n", i, i % 3, 20 + i);
  EXPECT_EQ(read(text)[0].of(Role::time).size(), 31u);
}

TEST(Rows, ACounterOfMessagesOrABitThatTogglesIsNoMotor) {
  std::string toggles = "time_s,current_A,housing_degC,alive\n", kinds = "time_s,current_A,housing_degC,id\n";
  for (int i = 0; i < 40; ++i) {
    toggles += fmt::format("{},1,{},{}\n", i, 20 + 0.1 * i, i % 2);
    kinds += i % 2 ? fmt::format("{},1,,7\n", i) : fmt::format("{},,{},8\n", i, 20 + 0.1 * i);
  }
  EXPECT_EQ(read(toggles)[0].of(Role::time).size(), 40u);
  EXPECT_EQ(read(kinds)[0].of(Role::time).size(), 40u);
}

TEST(Rows, SessionsMayBeWords) {
  const auto logs =
      read("time_s,current_A,housing_degC,session\n0,1,20,run_B\n1,1,21,run_B\n0,2,20,run_A\n1,2,22,run_A\n");
  ASSERT_EQ(logs.size(), 2u);
  says(logs[0].name, "(session run_A)");
  EXPECT_DOUBLE_EQ(logs[0].of(Role::current)[0], 2);
}

/// Rows a second apart, the housing warmer by a tenth each; what `cell` says for those it has a word for.
std::string rows_with(const std::function<std::string(int)>& cell, int rows = 200) {
  std::string text = head;
  for (int i = 0; i < rows; ++i) {
    const std::string said = cell(i);
    text += said.find(',') != std::string::npos || said.find(';') != std::string::npos
                ? said + "\n"
                : fmt::format("{},1,{}\n", i, said.empty() ? fmt::format("{:.1f}", 20 + 0.1 * i) : said);
  }
  return text;
}

TEST(Reader, AFewWordsAmongNumbersAreReadingsThatFailed) {
  const Log log = read(rows_with([](int i) { return i % 50 == 7 ? "OL" : ""; }))[0];
  EXPECT_TRUE(std::isnan(log.of(Role::housing)[7]));
  EXPECT_DOUBLE_EQ(log.of(Role::housing)[8], 20.8);
  says(fmt::format("{}", fmt::join(log.notes, " ")),
       "Cells of column 'housing_degC' with a word in them ('OL') count as not read: 4.");
  says(complaint(rows_with([](int i) { return i % 10 == 7 ? "OL" : ""; })), "line 9: 'OL' in column 'housing_degC'");
  says(complaint(rows_with([](int i) { return i == 7 ? "OL" : i == 9 ? "2O.9" : ""; })), "line 11: '2O.9'");
  for (const char* none : {"---", "#VALUE!", "#DIV/0!", "1.#QNAN", "<NA>", "NaT", "\\N", "n.a.", "?"})
    EXPECT_EQ(identify::count_told(read(rows_with([&](int i) { return i % 3 ? none : ""; }))[0].of(Role::housing)),
              67u);
}

TEST(Reader, AFewTornLinesAndRepeatedHeadersAreLeftOut) {
  const Log log = read(rows_with(
      [](int i) {
        return i == 50 ? "50,1" : i == 60 ? "60,1,26.0,61,1" : i == 70 ? "time_s,current_A,housing_degC" : "";
      },
      300))[0];
  EXPECT_EQ(log.of(Role::time).size(), 297u);
  const std::string notes = fmt::format("{}", fmt::join(log.notes, " "));
  says(notes, "Lines that have not as many cells as the header were left out: 2, the first line 52.");
  says(notes, "Lines that repeat the header were left out: 1.");
  says(complaint(rows_with([](int i) { return i % 50 == 7 ? "50,1" : ""; })),
       "line 9: the row has 2 of 3 cells; repair");
}

TEST(Reader, WhatALoggerWritesAboveItsTableMayBeATableToo) {
  const std::string rows = "0,1,20.0\n1,1,20.1\n2,1,20.2\n3,1,20.3\n";
  for (const char* above : {"Vendor,G Corporation,\nModel,GL240,\nAMP "
                            "settings,,\nCH,Signal,Input,Range\nCH1,i,TEMP,20\nCH2,i,TEMP,30\nCH3,T,TEMP,40\n",
                            "CH,U1-1,U1-2\nMode,Tc,Tc\nRange,auto,auto\nComment,,\n"})
    EXPECT_EQ(read(above + head + "s,A,degC\n" + rows)[0].of(Role::time).size(), 4u) << above;
}

TEST(Reader, DatesAreReadInEachFormThatCannotBeAnother) {
  const double first_s = read(head + "2026-11-21T08:15:30,1,20\n2026-11-21T08:16:00,1,21\n")[0].of(Role::time)[1];
  EXPECT_DOUBLE_EQ(first_s, 30);
  const char* pairs[][2] = {
      {"2026/11/21 08:15:30", "2026/11/22 08:15:30"},     {"21.11.2026 08:15:30", "22.11.2026 08:15:30"},
      {"21-Nov-2026 08:15:30", "22-Nov-2026 08:15:30"},   {"11/21/2026 8:15:30 AM", "11/22/2026 08:15:30 AM"},
      {"11/20/2026 8:15:30 PM", "11/21/2026 8:15:30 PM"}, {"11/20/2026 12:15:30 AM", "11/21/2026 12:15:30 AM"},
      {"2026-11-21 08:15", "2026-11-22 08:15"},           {"0 days 00:00:01", "1 days 00:00:01"}};
  for (const auto& [one, other] : pairs)
    EXPECT_DOUBLE_EQ(read(head + one + ",1,20\n" + other + ",1,21\n")[0].of(Role::time)[1], 86400) << one;
  EXPECT_DOUBLE_EQ(read(head + "11:59:30 AM,1,20\n12:00:30 PM,1,21\n")[0].of(Role::time)[1], 60);
  EXPECT_DOUBLE_EQ(read(head + "11:59:30 PM,1,20\n12:00:30 AM,1,21\n")[0].of(Role::time)[1], 60);
  EXPECT_DOUBLE_EQ(read(head + "11/20/2026 11:59:30 AM,1,20\n11/20/2026 12:00:30 PM,1,21\n")[0].of(Role::time)[1], 60);
  for (const char* either : {"21-21-2026 08:15:30", "2026.11.21 08:15:30", "2026-13-21 08:15:30"})
    says(complaint(head + either + ",1,20\n"), "nor a time as it is read");
}

TEST(Reader, PhasesTellWhatHeatsAlike) {
  std::string three = "time_s,phase_a_A,phase_b_A,phase_c_A,housing_degC\n",
              two = "time_s,phase_a_A,phase_c_A,housing_degC\n";
  for (int i = 0; i < 50; ++i) {
    const auto phase_A = [&](int k) { return 4 * std::cos(0.7 * i - 2.0943951 * k); };
    three += fmt::format("{},{},{},{},{}\n", i, phase_A(0), phase_A(1), phase_A(2), 20 + i);
    two += fmt::format("{},{},{},{}\n", i, phase_A(0), phase_A(2), 20 + i);
  }
  for (const std::string& text : {three, two}) {
    const Log log = read(text)[0];
    for (const double A : log.of(Role::current)) EXPECT_NEAR(A, 4 * std::sqrt(0.75), 1e-4);
  }
  says(complaint("time_s,phase_a_A,housing_degC\n0,1,20\n1,-1,21\n"), "alternates and does not tell how much flows");
  says(complaint("time_s,phase_a_A,phase_b_A,housing_degC\n0,1,1,20\n1,1,1,21\n"), "map all three phases");
  ColumnMap map;
  add_column(map, "current_A=I_u [A]");
  says(complaint("time_s,I_u [A],housing_degC\n0,1,20\n1,-1,21\n", map), "column 'I_u [A]' is called like one phase");
  EXPECT_EQ(read("time_s,I_u [A],housing_degC\n0,1,20\n1,1.1,21\n", map).size(), 1u) << "an effective value";
}

TEST(Reader, AColumnMayBeInPartsOfAUnit) {
  ColumnMap map;
  add_column(map, "current_A=I:1.5A");
  add_column(map, "housing_degC=T:0.01degC");
  add_column(map, "ambient_degC=F:0.1degF");
  const Log log = read("time_s,I,T,F\n0,2,2150,680\n1,4,2250,689\n", map)[0];
  EXPECT_DOUBLE_EQ(log.of(Role::current)[0], 3);
  EXPECT_DOUBLE_EQ(log.of(Role::housing)[1], 22.5);
  EXPECT_NEAR(log.of(Role::ambient)[0], 20, 1e-9);
  EXPECT_NEAR(log.of(Role::ambient)[1], 20.5, 1e-9);
  says(complaint(head + "0,1,2150\n1,1,2250\n"),
       "looks like parts of a degree; say --column housing_degC=housing_degC:0.01degC");
}

TEST(Reader, CellsThatNameTheirUnitAreReadInIt) {
  const Log log = read(head + "0 s,900 mA,293.15 K\n60 s,1000 mA,294.15 K\n")[0];
  EXPECT_DOUBLE_EQ(log.of(Role::current)[0], 0.9);
  EXPECT_NEAR(log.of(Role::housing)[1], 21, 1e-9);
  says(log.notes[0], "Units are taken from the table: current_A in mA, housing_degC in K.");
  says(complaint(head + "0,900 mA,20\n60,1 A,21\n"), "line 3: '1 A' in column 'current_A' is not a number");
  says(complaint(head + "0,9 %,20\n60,1 A,21\n"), "line 2: '9 %'");
  EXPECT_NEAR(read(head + "0,1,68\u00b0F\n1,1,69\u00b0F\n")[0].of(Role::housing)[0], 20, 1e-9);
  says(complaint(head + "0,1,68F\n1,1,69F\n"), "'68F'");  // may be what a counter says
  EXPECT_NEAR(read(head + "s,A,\u00b0F\n0,1,68\n1,1,69\n")[0].of(Role::housing)[0], 20, 1e-9);
}

TEST(Reader, OneValueARowIsRefusedWithWhatToDo) {
  says(complaint("time,_field,_value\n0,current,1\n0,temp,20\n1,current,1\n"),
       "each row has one value ('_value') and what it is of ('_field'); pivot the table");
  says(complaint("Timestamp,Name,Value\n0,/motor/current,1\n0,/motor/temp,20\n"), "what it is of ('Name')");
  says(complaint("Time;Message;Signal;PhysValue;Unit\n0;MCU;Temp;20;degC\n0;MCU;I;1;A\n"), "one value ('PhysValue')");
}

TEST(Reader, AColumnCalledTimeIsTheTime) {
  for (const char* name : {"time", "Timestamp", "_time", "Zeit", "t"}) {
    const Log log = read(std::string(name) + ",current_A,housing_degC\n0,1,20\n5,2,21\n")[0];
    EXPECT_DOUBLE_EQ(log.of(Role::time)[1], 5);
    says(log.notes[0], fmt::format("Column '{}' is taken for the time", name));
  }
  EXPECT_DOUBLE_EQ(read("Time (ms),current_A,housing_degC\n0,1,20\n500,2,21\n")[0].of(Role::time)[1], 0.5);
  EXPECT_DOUBLE_EQ(read("start_s,t_s,current_A,housing_degC\n9,0,1,20\n9,5,2,21\n")[0].of(Role::time)[1], 5);
  EXPECT_DOUBLE_EQ(read("timestamp_ms,current_A,housing_degC\n0,1,20\n500,2,21\n")[0].of(Role::time)[1], 0.5);
  says(complaint("time,t,current_A,housing_degC\n0,0,1,20\n1,1,1,21\n"), "a time column is missing");
}

TEST(Reader, ATimeThatFewLoggersCallSoIsTheTimeWhereNoColumnIsCalledTime) {
  for (const char* name : {"Seconds", "ts", "X_Value", ":Time"})
    EXPECT_DOUBLE_EQ(read(std::string(name) + ",current_A,housing_degC\n0,1,20\n5,2,21\n")[0].of(Role::time)[1], 5);
  EXPECT_DOUBLE_EQ(read("TimeUS,current_A,housing_degC\n0,1,20\n500000,2,21\n")[0].of(Role::time)[1], 0.5);
  EXPECT_DOUBLE_EQ(read("Seconds,time,current_A,housing_degC\n9,0,1,20\n9,5,2,21\n")[0].of(Role::time)[1], 5);
  says(complaint("seconds,ts,current_A,housing_degC\n0,0,1,20\n1,1,1,21\n"), "a time column is missing");
}

TEST(Reader, DatesBetweenStrokesAreReadInTheOrderInWhichTheirDaysFollowEachOther) {
  // As spreadsheets write them in America and in Britain, and Keysight's recorders.
  const auto log = [](const std::string& first, const std::string& last) {
    return read("Time,current_A,housing_degC\n" + first + ",1,20\n" + last + ",2,21\n")[0];
  };
  EXPECT_DOUBLE_EQ(log("1/8/2026 17:30", "1/8/2026 17:31").of(Role::time)[1], 60);
  EXPECT_DOUBLE_EQ(log("01/08/2026 17:30:00:250", "01/08/2026 17:30:00:500").of(Role::time)[1], 0.25);
  EXPECT_DOUBLE_EQ(log("31-12-2026 23:59:59", "01-01-2027 00:00:01").of(Role::time)[1], 2);
  EXPECT_DOUBLE_EQ(log("12/31/2026 23:59:59", "1/1/2027 00:00:01").of(Role::time)[1], 2);
  EXPECT_DOUBLE_EQ(log("31/12/2026 23:59:59", "1/1/2027 00:00:01").of(Role::time)[1], 2);
  const Log months = log("1/8/2026 23:59:59", "1/9/2026 00:00:01"),
            days = log("8/1/2026 23:59:59", "9/1/2026 00:00:01");
  EXPECT_DOUBLE_EQ(months.of(Role::time)[1], 2);
  EXPECT_DOUBLE_EQ(days.of(Role::time)[1], 2);
  says(months.notes.at(0),
       "Dates of column 'Time' are read with the month first, so that they span 2.31e-05 d and not 30.");
  says(days.notes.at(0), "with the day first");
  says(complaint("Time,current_A,housing_degC\n13/31/2026 17:30,1,20\n13/31/2026 17:31,2,21\n"), "nor a time as it is");
}

TEST(Reader, ADateBesideATimeOfDayTellsItsDay) {
  // As radios and spreadsheets write them; the second row is thirty hours after the first.
  const auto log = [](const std::string& first, const std::string& last) {
    return read("Date,Time,current_A,housing_degC\n" + first + ",20:00:00.5,1,20\n" + last + ",02:00:01,2,21\n")[0];
  };
  for (const auto& [first, last] : {std::pair("2026-11-21", "2026-11-23"), std::pair("21.11.2026", "23.11.2026")})
    EXPECT_NEAR(log(first, last).of(Role::time)[1], 30 * 3600 + 0.5, 1e-6);
  says(log("2026-11-21", "2026-11-23").notes.at(1), "Column 'Date' tells the day of 'Time'.");
  for (const auto& [first, last] : {std::pair("1/2/2026", "3/2/2026"), std::pair("2/1/2026", "2/3/2026")})
    EXPECT_NEAR(log(first, last).of(Role::time)[1], 30 * 3600 + 0.5, 1e-6);
  says(complaint("Date,current_A,housing_degC\n1/2/2026,1,20\n1/2/2026,2,21\n"), "a time column is missing");
  EXPECT_DOUBLE_EQ(
      read("date,time_s,current_A,housing_degC\n2026-11-21,0,1,20\n2026-11-22,5,2,21\n")[0].of(Role::time)[1], 5);
}

TEST(Reader, AllThatIsMissingIsNamedAtOnceWithWhatItMayBe) {
  const std::string sentence = complaint("Start time [s],Current [A],T_winding [C]\n0,1,20\n1,1,21\n");
  says(sentence, "a time column and the heat input (current_A, iq_A, power_W or torque_Nm) and a measured temperature");
  says(sentence, "--column time_s=\"Start time [s]\"");
  says(sentence, "--column current_A=\"Current [A]\"");
  says(sentence, "--column core_degC=\"T_winding [C]\"");
}

TEST(Reader, WhatIsMissingIsToldWithAllThatTheFileHasOfUse) {
  // Sessions of a bench, without a clock.
  const std::string bench = complaint(
      "u_q,coolant,coil_end,i_d,i_q,stator,rotor_speed,yoke,ambient,torque,profile_id\n"
      "1,20,20,0,1,1,5,20,22,1,7\n2,21,22,1,2,2,6,21,23,2,7\n");
  for (const char* column : {"iq_A=i_q", "id_A=i_d", "housing_degC=yoke", "core_degC=coil_end", "ambient_degC=ambient",
                             "coolant_degC=coolant", "session=profile_id", "speed_rad_per_s=rotor_speed"})
    says(bench, std::string("--column ") + column);
  const std::string stand =
      complaint("Time (s),Winding Temp (\u00b0C),Ambient (\u00b0C),Stator (\u00b0C)\n0,20,20,20\n1,30,20,21\n");
  says(stand, "--column housing_degC=\"Stator (\u00b0C)\"");
  says(stand, "--column core_degC=\"Winding Temp (\u00b0C)\"");
  says(stand, "--column current_A=NAME, or join it to this table by time if it was recorded in another");
  const std::string drive = complaint("ms_today,temp_motor,q_axis_current,vesc_id,d_axis_current,erpm\n0,20,1,3,0,1\n");
  says(drive, "--column id_A=d_axis_current");
  says(drive, "--column speed_rad_per_s=erpm (electrical: with its unit, as :0.1429rpm of seven pole pairs)");
}

TEST(Reader, ATemperatureWithoutAUnitBesideOthersInFahrenheitIsAskedFor) {
  ColumnMap map;
  add_column(map, "housing_degC=Motor Temp");
  const std::string rows = "time_s,current_A,Probe (\u00baF),Motor Temp\n0,1,71,71\n1,2,71,72\n";
  says(complaint(rows, map),
       "column 'Motor Temp' tells no unit, and 'Probe (\u00baF)' is in \u00baF; say --column housing_degC=\"Motor "
       "Temp:degF\", or :degC");
  ColumnMap said;
  add_column(said, "housing_degC=Motor Temp:degF");
  EXPECT_NEAR(read(rows, said)[0].of(Role::housing)[1], 22.2, 0.1);
  ColumnMap own;
  add_column(own, "ambient_degC=Probe (\u00baF)");
  EXPECT_EQ(read("time_s,current_A,Probe (\u00baF),housing_degC\n0,1,71,21\n1,2,71,22\n", own)[0].of(Role::housing)[1],
            22);
}

TEST(Reader, AnAmplitudeWithoutTheOtherIsToldWithItsColumn) {
  ColumnMap map;
  add_column(map, "iq_A=motor_iq");
  const auto notes = read("time_s,motor_id,motor_iq,housing_degC\n0,1,1,20\n1,2,2,21\n", map)[0].notes;
  says(fmt::format("{}", fmt::join(notes, " ")), "say --column id_A=motor_id");
}

TEST(Reader, TurnsOfTheFieldAreNoTurnsOfTheShaft) {
  for (const std::string name : {"erpm", "eRPM", "elec_freq_Hz", "electrical_speed"}) {
    const std::string rows = "time_s,current_A," + name + ",housing_degC\n0,1,0,20\n1,2,7,21\n";
    ColumnMap map;
    add_column(map, "speed_rad_per_s=" + name);
    says(complaint(rows, map), "counts turns of the field; say --column speed_rad_per_s=" + name + ":0.1429rpm");
    ColumnMap said;
    add_column(said, "speed_rad_per_s=" + name + ":0.5rpm");
    EXPECT_NEAR(read(rows, said)[0].of(Role::speed)[1], 3.5 * M_PI / 30, 1e-9);
  }
}

TEST(Reader, WhatAColumnMayBeIsToldByItsWordsAndByWhatMoves) {
  const std::string robot = complaint("input_speed,output_torque,timestamp_ms,temp\n1,1,1,20\n1,2,2,21\n");
  says(robot, "--column torque_Nm=output_torque");  // a timestamp is no "amp"
  says(robot, "--column housing_degC=temp");        // nor "input_speed" a "t_"
  const std::string dyno = complaint("Input current,Motor q-axis current,FET temp\n0,1,20\n0,2,21\n");
  says(dyno, "--column iq_A=\"Motor q-axis current\"");  // the supply's never moves
  says(complaint("I_bus,t\n1,0\n2,1\n"), "--column current_A=NAME");
  const std::string vesc = complaint("ms_today,temp_motor,current_motor,erpm\n0,20,1,1\n1,21,2,2\n");
  for (const char* column : {"time_s=ms_today:ms", "iq_A=current_motor"}) says(vesc, column);
  says(complaint("time_s,q_current,temp\n0,1,20\n1,2,21\n"), "--column iq_A=q_current");
  says(complaint("time_s,i_a,i_b,temp\n0,1,1,20\n1,2,2,21\n"), "--column phase_a_A=i_a");
  says(complaint("time_s,I_U_rms,I_V_rms,temp\n0,1,1,20\n1,2,2,21\n"), "--column current_A=I_U_rms:1.2247A");
  const std::string german =
      complaint("time_s,Motorstrom,Motordrehzahl,T_Gehaeuse,T_Wicklung\n0,1,1,20,20\n1,2,2,21,22\n");
  for (const char* said : {"current_A=Motorstrom", "speed_rad_per_s=Motordrehzahl", "housing_degC=T_Gehaeuse"})
    says(german, said);
  says(complaint("time,motor_rms_current,temp\n0,1,20\n1,2,21\n"), "--column current_A=motor_rms_current:1.2247A");
  says(complaint("Date,Time,P_loss,temp\n1/2/2026,1:00 PM,1,20\n"), "--column power_W=P_loss");
  says(complaint("time_s,Power (W),Stator Body (\u00b0C)\n0,1,20\n"),
       "--column power_W=\"Power (W)\" if that is what heats the winding");
}

TEST(Reader, WhatHeatsAControllerOrFeedsItIsNoGuess) {
  // As VESC, ArduPilot, ODrive and Talon call theirs; the motor's sensor is not connected in the first two.
  const std::string vesc = complaint("ms_today,temp_mos_max,temp_motor,current_motor\n0,20,-1,1\n1,30,-1,2\n");
  says(vesc, "--column housing_degC=temp_motor, which says -1 in all rows: see whether its sensor is connected");
  says(complaint("TimeUS,Curr,Temp,MotTemp\n0,1,20,0\n1,2,30,0\n"), "--column housing_degC=MotTemp");
  says(complaint("time_s,current_A,fet_thermistor.temperature,motor_thermistor.temperature\n0,1,20,20\n1,2,30,21\n"),
       "--column housing_degC=motor_thermistor.temperature");
  says(complaint("time_s,current_A,esc_temperature\n0,1,20\n1,2,30\n"), "--column housing_degC=NAME");
  const std::string talon = complaint("time_s,SupplyCurrent,StatorCurrent,DeviceTemp\n0,1,1,20\n1,2,3,21\n");
  says(talon, "--column current_A=StatorCurrent");
  says(talon, "--column housing_degC=DeviceTemp");
  says(complaint("time_s,Iq_setpoint,Iq_measured,temp\n0,1,1,20\n1,2,2,21\n"), "--column iq_A=Iq_measured");
}

TEST(Reader, CountsAndTheSpeedOfASatelliteReceiverAreNoGuess) {
  const std::string raw = complaint("time_s,motor_current_raw,iq,motor_temp\n0,100,1,20\n1,200,2,21\n");
  says(raw, "--column iq_A=iq");
  const std::string wheel = complaint("time_s,gps_speed,speed,phase_current,motor_temp\n0,0,1,1,20\n1,5,2,2,21\n");
  says(wheel, "--column speed_rad_per_s=speed ");
  says(complaint("time_s,actual_current_0,actual_qd_0,joint_temp_0\n0,1,1,20\n1,2,2,21\n"),
       "--column speed_rad_per_s=actual_qd_0");
}

TEST(Reader, AChannelWhoseUnitAloneTellsWhatItIsIsProposedWhereNoNameDoes) {
  const std::string recorder = complaint("Time,1-1[A],1-2[C],1-3[V]\n0,1,20,5\n1,2,21,5\n");
  says(recorder, "--column current_A=\"1-1[A]\" if it is the motor's own current");
  says(recorder, "--column housing_degC=\"1-2[C]\"");
  const std::string supply = complaint("Time,batt [A],esc [C]\n0,1,20\n1,2,21\n");
  says(supply, "--column current_A=NAME");
  says(supply, "--column housing_degC=NAME");
}

TEST(Reader, AMotorsTemperatureAndARoomsAreKnownByWhatFewCallThem) {
  for (const char* name : {"tmpm", "Tmot", "t_mot", "temperature_motor"})  // OpenInverter's, and Kinova's
    says(complaint(fmt::format("time_s,iq_A,temperature_core,tmp,{}\n0,1,30,1,20\n1,2,31,2,21\n", name)),
         fmt::format("--column housing_degC={}.", name));
  for (const char* name : {"T_amb", "Tamb", "temp_amb"})
    says(complaint(fmt::format("time_s,iq_A,motor_temp,{}\n0,1,20,20\n1,2,21,20\n", name)),
         fmt::format("--column ambient_degC={}.", name));
  for (const char* name : {"I_phase", "I_mot"})
    says(complaint(fmt::format("time_s,I_bat,{},motor_temp\n0,1,1,20\n1,2,2,21\n", name)),
         fmt::format("--column current_A={};", name));
  says(complaint("TimeString;VarName;VarValue\n0;I;1\n0;T;20\n"), "each row has one value ('VarValue')");
}

TEST(Reader, OfThousandsOfColumnsTheFirstHundredAreNamed) {
  std::string text = "time_s,current_A";
  for (int i = 0; i < 3000; ++i) text += fmt::format(",x{}", i);
  text += "\n0,1";
  for (int i = 0; i < 3000; ++i) text += ",0";
  says(complaint(text + "\n"), "x96, x97 and 2902 more.");
}

TEST(Reader, AWordOfSeveralMeaningsIsReadBesideOthers) {
  const std::string servo = complaint(
      "time_s,current_state,current_speed,amp_hours,current_temperature,load_current\n"
      "0,1,1,0,20,1\n1,8,2,1,21,2\n");
  says(servo, "--column current_A=load_current");
  says(servo, "--column housing_degC=current_temperature");
  says(servo, "--column speed_rad_per_s=current_speed");
}

TEST(Reader, AGuessIsOfOneMotor) {
  // As PX4 and Unitree number theirs.
  const std::string esc = complaint(
      "timestamp,esc[0].esc_current,esc[0].motor_temperature,esc[1].esc_current,esc[1].motor_temperature,esc[1].esc_"
      "rpm\n"
      "0,1,0,2,20,9\n1,2,0,3,21,10\n");
  says(esc, "--column current_A=\"esc[0].esc_current\"");
  says(esc, "--column housing_degC=\"esc[0].motor_temperature\"");
  const std::string joints = complaint(
      "time_s,motor_0_temperature_0,motor_1_dq,motor_1_tau_est,motor_1_temperature_0\n0,20,1,1,20\n1,21,2,2,21\n");
  for (const char* column :
       {"torque_Nm=motor_1_tau_est", "housing_degC=motor_1_temperature_0", "speed_rad_per_s=motor_1_dq"})
    says(joints, std::string("--column ") + column);
  says(complaint("time,left.current,left.temp,right.current,right.temp\n0,1,0,1,20\n1,2,0,2,21\n"),
       "--column housing_degC=left.temp");
  says(complaint("time_s,current_motor,temp_motor,temp_case\n0,1,0,20\n1,2,0,21\n"), "--column housing_degC=temp_case");
  // A column that is read now and then moves all the same.
  says(complaint("time_s,current_A,temp_1,temp_2\n0,1,20,20\n1,2,20,\n2,2,20,21\n3,2,20,\n"),
       "--column housing_degC=temp_2");
}

TEST(Reader, WhatIsOfUseAndNotUsedIsSaid) {
  const std::string rows = "time_s,current_A,housing_degC,velocity,T_winding,motor\n0,1,20,0,20,1\n1,2,21,9,30,1\n";
  const std::string notes = fmt::format("{}", fmt::join(read(rows)[0].notes, " "));
  says(notes, "say --column speed_rad_per_s=velocity (and its unit, as :rpm or :rev/s)");
  says(notes, "say --column core_degC=T_winding.");
  const std::string core_only = "time_s,current_A,core_degC,T_case,n_rpm\n0,1,20,20,0\n1,2,21,21,9\n";
  const std::string told = fmt::format("{}", fmt::join(read(core_only)[0].notes, " "));
  says(told, "say --column housing_degC=T_case.");
  says(told, "say --column speed_rad_per_s=n_rpm.");
  const std::string of_a_car =
      fmt::format("{}", fmt::join(read("time_s,current_A,housing_degC,speed_mps\n0,1,20,0\n1,2,21,9\n")[0].notes, " "));
  EXPECT_EQ(of_a_car.find("speed_mps"), std::string::npos) << "metres a second are no motor's";
}

TEST(Reader, APowerThatIsNegativeIsNoHeat) {
  std::string text = "time_s,power_W,housing_degC\n", meter = text;
  for (int i = 0; i < 50; ++i) {
    text += fmt::format("{},{},{}\n", i, i % 5 == 4 ? -8 : 20, 20 + i);
    meter += fmt::format("{},{},{}\n", i, i % 5 == 4 ? -0.2 : 20, 20 + i);
  }
  says(complaint(text), "power_W is negative in 10 rows, as what heats a winding never is");
  EXPECT_TRUE(read(meter)[0].has(Role::power));
}

TEST(Reader, ColumnsThatAreNormalisedAreRefused) {
  std::string text = "time_s,current_A,speed_rad_per_s,housing_degC\n";
  for (int i = 0; i < 50; ++i) text += fmt::format("{},{},{},{}\n", i, 0.05 * i - 1, 1.5 - 0.02 * i, 0.04 * i - 1.2);
  says(complaint(text), "as if they were normalised");
}

TEST(Reader, ATemperatureBelowZeroKelvinIsASensorThatDidNotAnswer) {
  const Log log = read(rows_with([](int i) { return i < 5 ? "-999" : ""; }))[0];
  EXPECT_EQ(identify::count_told(log.of(Role::housing)), 195u);
  says(fmt::format("{}", fmt::join(log.notes, " ")), "housing_degC is below 0 K in 5 rows, which count as not read.");
  says(complaint(rows_with([](int i) { return i < 50 ? "-999" : ""; })), "-80 to 600 degC is possible");
}

TEST(Reader, TheLeastOf16BitsIsNoReadingHoweverOften) {
  const std::string often = rows_with([](int i) { return i < 50 ? "-32768" : ""; });
  for (const char* unit : {"", ":0.9degC"}) {
    ColumnMap map;
    if (*unit != 0) add_column(map, std::string("housing_degC=housing_degC") + unit);
    const Log log = read(often, map)[0];
    EXPECT_EQ(identify::count_told(log.of(Role::housing)), 150u) << unit;
    says(fmt::format("{}", fmt::join(log.notes, " ")), "is -32768 in 50 rows, which count as not read.");
  }
}

TEST(Reader, RowsWithoutAClockThatWereSortedOrShuffledAreNotTakenForALog) {
  ColumnMap map;
  map.period_s = 0.5;
  std::vector<std::string> rows;
  for (int i = 0; i < 400; ++i)
    rows.push_back(fmt::format("{},{}\n", i < 200 ? 5 : 0, 20 + (i < 200 ? i : 400 - i) / 5.0));
  const auto text = [&] { return fmt::format("current_A,housing_degC\n{}", fmt::join(rows, "")); };
  EXPECT_EQ(read(text(), map)[0].of(Role::housing).size(), 400u);
  std::shuffle(rows.begin(), rows.end(), std::mt19937_64(1));
  says(complaint(text(), map), "as if the rows were sorted by another column, or shuffled");
}

TEST(Reader, AMapThatComesAlongIsNamedWhereItFits) {
  ColumnMap none;
  none.folder = HOTCORE_SOURCE_DIR "/identify/maps";
  const std::string kaggle =
      "u_q,coolant,stator_winding,motor_speed,i_d,i_q,stator_yoke,ambient,torque,profile_id\n"
      "0,18,19,0,0,0,18,19,0,17\n";
  says(complaint(kaggle, none), "say --map " HOTCORE_SOURCE_DIR "/identify/maps/paderborn_sessions.toml");
  says(complaint("ms_today,current_motor,temp_motor\n0,1,20\n", none), "identify/maps/vesc.toml");
  // Who has mapped a column is told of the others.
  add_column(none, "housing_degC=stator_yoke");
  says(complaint(kaggle, none), "map it with --column iq_A=i_q");
}

TEST(Reader, ACurrentThatMayBeTheSuppliesIsProposedAndReadWithAWordOfIt) {
  // As APD and Castle export theirs, and PX4 and ArduPilot log them.
  const char* whose = " if it is the motor's own current and not the supply's";
  says(complaint("t,Volt,Curr,MotTemp\n0,24,1,20\n1,24,2,21\n"), std::string("current_A=Curr") + whose);
  const std::string apd =
      complaint("Voltage (V),Current (A),Phase Current (A),Temperature (C)\n70,1,4,20\n70,2,6,21\n");
  says(apd, "current_A=\"Phase Current (A)\";");
  const auto notes_of = [](const std::string& columns, const std::string& name) {
    ColumnMap map;
    add_column(map, "current_A=" + name);
    return fmt::format(
        "{}", fmt::join(read("time_s,housing_degC," + columns + "\n0,20,1,24\n1,21,2,24\n", map)[0].notes, " "));
  };
  says(notes_of("Curr,Volt", "Curr"), "Column 'Curr' beside 'Volt' may be what the supply gives");
  says(notes_of("supply_current,x", "supply_current"), "'supply_current' may be what the supply gives");
  for (const char* columns : {"motor_current,Volt", "I,V_phase", "current,motor_voltage"}) {
    const std::string name(columns, std::string(columns).find(','));
    EXPECT_EQ(notes_of(columns, name).find("supply"), std::string::npos) << columns;
  }
}

TEST(Reader, AControllersTemperatureThatWasMappedIsSaidToBeOne) {
  const auto notes_of = [](const std::string& name) {
    ColumnMap map;
    add_column(map, "housing_degC=" + name);
    return fmt::format("{}", fmt::join(read("time_s,current_A," + name + "\n0,1,20\n1,2,21\n", map)[0].notes, " "));
  };
  for (const char* name : {"temp_mos", "esc_temperature", "driver temp"}) says(notes_of(name), "what drives the motor");
  for (const char* name : {"temp_motor", "esc[0].motor_temperature", "T_case"})
    EXPECT_EQ(notes_of(name).find("drives"), std::string::npos) << name;
}

TEST(Reader, OfATemperatureThatMayBeTheDrivesOwnItIsSaid) {
  const auto notes_of = [](const std::string& name) {
    ColumnMap map;
    add_column(map, "housing_degC=" + name);
    return fmt::format("{}", fmt::join(read("time_s,current_A," + name + "\n0,1,20\n1,2,21\n", map)[0].notes, " "));
  };
  for (const char* name : {"temperature", "Present Temperature (°C)", "system_temp", "temp_c"})
    says(notes_of(name), "does not tell what it is the temperature of");
  for (const char* name : {"motor_temperature", "T_case", "Tmp1", "temperature_stator"})
    EXPECT_EQ(notes_of(name).find("does not tell"), std::string::npos) << name;
}

TEST(Reader, ATemperatureCalledAsOfAnotherMotorIsSaidToBe) {
  const auto notes_with = [](const std::string& housing) {
    ColumnMap map;
    add_column(map, "iq_A=M1 Iq [A]");
    add_column(map, "housing_degC=" + housing);
    const std::string table = "time_s,M1 Iq [A],M2 Iq [A],M1 T case,M2 T case\n0,1,0,20,20\n1,2,1,21,20\n";
    return fmt::format("{}", fmt::join(read(table, map)[0].notes, " "));
  };
  says(notes_with("M2 T case"), "Column 'M2 T case' is called as if it were of another motor than 'M1 Iq [A]'");
  EXPECT_EQ(notes_with("M1 T case").find("another motor"), std::string::npos);
}

TEST(Masks, ReadingsOfALooseSensorAreMaskedAndThoseOfAWindingAreNot) {
  const std::string text = rows_with([](int i) { return i >= 80 && i < 120 ? fmt::format("{}", 150 + i % 2) : ""; });
  const Log log = read(text)[0];
  EXPECT_EQ(identify::count_told(log.of(Role::housing)), 160u);
  says(fmt::format("{}", fmt::join(log.notes, " ")), "as of a loose sensor: 40 readings masked, the first at 80.0 s");
  std::string core = text;
  core.replace(core.find("housing"), 7, "core");
  EXPECT_EQ(identify::count_told(read(core)[0].of(Role::core)), 200u);
  const std::string stays = rows_with([](int i) { return i >= 80 ? fmt::format("{}", 150 + i % 2) : ""; });
  EXPECT_EQ(identify::count_told(read(stays)[0].of(Role::housing)), 200u);
}

TEST(Reader, TheIndexThatPandasWritesHasAName) {
  ColumnMap map;
  add_column(map, "time_s=#1");
  EXPECT_DOUBLE_EQ(read(",current_A,housing_degC\n0,1,20\n1,2,21\n", map)[0].of(Role::time)[1], 1);
}

TEST(Reader, AColumnMappedToOneRoleIsNotReadAsAnotherByItsOwnName) {
  ColumnMap map;
  identify::add_column(map, "core_degC=housing_degC");
  const Log log = read(head + "0,1,20\n1,2,21\n", map)[0];
  EXPECT_DOUBLE_EQ(log.of(Role::core)[1], 21);
  EXPECT_FALSE(log.has(Role::housing));
}

TEST(Reader, EmptyCellsAreMissingValues) {
  const Log log = read("time_s,current_A,housing_degC,core_degC\n0,1,20,25\n1,1,,\n2,1,NaN,\n3,1,21,\n")[0];
  EXPECT_TRUE(std::isnan(log.of(Role::housing)[1]));
  EXPECT_TRUE(std::isnan(log.of(Role::housing)[2]));
  EXPECT_DOUBLE_EQ(log.of(Role::core)[0], 25);
}

TEST(Reader, SessionsBecomeLogsOfTheirOwn) {
  const auto logs = read("session,time_s,current_A,housing_degC\n1,0,1,20\n1,1,1,20\n2,0,1,30\n2,1,2,31\n");
  ASSERT_EQ(logs.size(), 2u);
  EXPECT_DOUBLE_EQ(logs[1].of(Role::housing)[1], 31);
}

TEST(Reader, ATornFileIsRefusedWithItsLine) {
  says(complaint(head + "0,1,20\n1,1"), "line 3: the row has 2 of 3 cells and the file ends in it, so it was cut off");
}

TEST(Reader, ARowOfTheWrongLengthIsRefusedWithItsLine) {
  says(complaint(head + "0,1,20\n1,1,20,7\n2,1,20\n"), "line 3: the row has 4 of 3 cells");
}
TEST(Reader, TextInANumberColumnIsRefusedWithLineAndColumn) {
  says(complaint(head + "0,1,20\n1,oops,20\n"), "line 3: 'oops' in column 'current_A' is not a number");
}
TEST(Reader, WordsInAColumnThatNothingUsesDoNoHarm) {
  const auto logs = read(
      "stamp,time_s,current_A,housing_degC,state\n2026-11-22 12:00:00,0,1,20,rest\n2026-11-22 12:00:01,1,2,21,push\n");
  EXPECT_DOUBLE_EQ(logs[0].of(Role::current)[1], 2);
}
TEST(Reader, WhatALoggerWritesBeforeTheTableIsSkippedAndAStopwatchIsRead) {
  ColumnMap map;
  for (const char* column : {"time_s=Time (s)", "current_A=Current", "housing_degC=Body"})
    identify::add_column(map, column);
  const Log log = read(
      "\"Device: X\"\n\"Rate\",\"3.3\"\n\"Time (s)\",\"Current\",\"Body\"\n\"0:59.7\",\"1\",\"20\"\n"
      "\"1:00.1\",\"1\",\"21\"\n\"1:00:00.5\",\"1\",\"22\"\n",
      map)[0];
  EXPECT_NEAR(log.of(Role::time)[1], 0.4, 1e-9);
  EXPECT_NEAR(log.of(Role::time)[2], 3540.8, 1e-9);
}
TEST(Reader, AnEmptyFileIsRefused) { says(complaint(""), "the file is empty"); }
TEST(Reader, AHeaderAloneIsRefused) { says(complaint(head), "no row"); }
TEST(Reader, NumbersInsteadOfAHeaderAreRefused) { says(complaint("0,1,20\n1,1,20\n"), "where the header should be"); }
TEST(Reader, ALineOfTenMegabytesIsRefused) {
  says(complaint(head + std::string(10'000'000, '7') + "\n"), "10.0 MB without a line end");
}
TEST(Reader, BinaryIsRefused) { says(complaint(head + std::string("0,1,\0", 5) + "\n"), "not a text file"); }
TEST(Reader, AMissingColumnIsNamedWithWhatThereIs) {
  says(complaint("time_s,current_A\n0,1\n1,1\n"), "a measured temperature (housing_degC or core_degC) is missing");
  says(complaint("when,current_A,housing_degC\n0,1,20\n"), "time column is missing");
  says(complaint("time_s,housing_degC\n0,20\n"), "heat input");
}
TEST(Reader, ATorqueTellsTheCurrentWhereNothingElseDoes) {
  const std::string text = "time_s,torque_Nm,housing_degC\n0,-0.6,20\n1,1.2,20\n";
  const Log free = read(text)[0];
  EXPECT_DOUBLE_EQ(free.of(Role::iq)[0], -0.6);
  says(free.notes.front(), "square of the true A/N m");
  wire::Motor motor{};
  motor.pole_pairs = 4;
  motor.flux_linkage_Wb = 0.01;  // 0.06 N m/A
  motor.rated_current_A = 2;
  const Log known = identify::logs_of(identify::read_table(file(text)), {}, motor)[0];
  EXPECT_DOUBLE_EQ(known.of(Role::iq)[1], 20);
  EXPECT_FALSE(known.has(Role::torque));
  says(known.notes.front(), "0.06 N m/A");
  motor.rated_current_A = 0.4;
  EXPECT_THROW(identify::logs_of(identify::read_table(file(text)), {}, motor), UserError) << "a joint's, behind a gear";
  const Log both = read("time_s,torque_Nm,current_A,housing_degC\n0,1,2,20\n1,1,2,20\n")[0];
  EXPECT_FALSE(both.has(Role::iq));
  says(both.notes.front(), "torque_Nm is not used");
}
TEST(Reader, AMappedColumnThatIsNotThereIsNamedWithTheNearest) {
  ColumnMap map;
  identify::add_column(map, "housing_degC=T_bodi");
  says(complaint("time_s,current_A,T_body\n0,1,20\n", map, 2), "did you mean 'T_body'?");
}
TEST(Reader, AColumnsNameMayBeginWithAColon) {
  ColumnMap map;
  identify::add_column(map, "housing_degC=:Motor");
  EXPECT_DOUBLE_EQ(read("time_s,current_A,:Motor\n0,1,20\n1,1,21\n", map)[0].of(Role::housing)[1], 21);
}

TEST(Reader, AColumnsNameMayHoldAColon) {
  ColumnMap map;
  identify::add_column(map, "housing_degC=T:case");
  identify::add_column(map, "core_degC=T:K");
  const std::string text = "time_s,current_A,T:case,T:K\n0,1,20,293.15\n1,1,21,294.15\n";
  const Log log = read(text, map)[0];
  EXPECT_DOUBLE_EQ(log.of(Role::housing)[1], 21);
  EXPECT_NEAR(log.of(Role::core)[1], 21, 1e-9) << "a name as a whole, whose unit is said all the same";
  ColumnMap mistyped;
  identify::add_column(mistyped, "housing_degC=T:degD");
  const std::string sentence = complaint(text, mistyped, 2);
  says(sentence, "column 'T:degD' for housing_degC is missing");
  says(sentence, "'degD' is no unit for a column 'T' (units: ");
}
TEST(Reader, TimeThatRunsBackwardsIsRefusedWithItsLine) {
  says(complaint(head + "0,1,20\n1,1,20\n0.5,1,20\n2,1,20\n"), "line 4: time runs backwards from 1 to 0.5 s");
}
TEST(Reader, WhatToDoAboutTimeThatRunsBackwardsGoesByHowItDoes) {
  std::string set = head, mixed = head, joined = head;
  for (int i = 0; i < 40; ++i) {
    const std::string rest = ",1," + std::to_string(20 + i) + "\n";
    set += std::to_string(i < 20 ? i : i - 3) + rest;
    mixed += std::to_string(i ^ 1) + rest;
    joined += std::to_string(i % 20) + rest;
  }
  says(complaint(set),
       "line 22: time runs backwards from 19 to 17 s (a clock that was set while it recorded); add 3 s to the times");
  says(complaint(mixed), "in 20 places (rows out of order); sort the rows by time");
  says(complaint(joined), "split the file there or give it a session column");
  says(complaint("time_s,current_A,housing_degC\n2026-10-25 02:59:58,1,20\n2026-10-25 02:59:59,1,20\n"
                 "2026-10-25 02:00:00,1,21\n2026-10-25 02:00:01,1,21\n"),
       "(by an hour, as where summer time ends); add 3600 s to the times from there on");
}
TEST(Reader, AHeaderInAUnitOfOneLetterIsRefusedWithTheConversion) {
  says(complaint("time_s,current_A,housing_F\n0,1,20\n"), "--column housing_degC=housing_F:F");
  says(complaint("time_h,current_A,housing_degC\n0,1,20\n"), "--column time_s=time_h:h");
}
TEST(Reader, KelvinIsRecognised) { says(complaint(head + "0,1,293\n1,1,294\n"), "looks like kelvin"); }
TEST(Reader, TenthsOfADegreeAreNoKelvin) {
  says(complaint(head + "0,1,239\n1,1,331\n"),
       "looks like tenths of a degree; say --column housing_degC=housing_degC:0.1degC");
  says(complaint(head + "0,1,281\n1,1,731\n"), "looks like tenths of a degree");
  says(complaint("time_s,current_A,housing_degC,ambient_degC\n0,1,192,188\n1,1,331,189\n"), "ambient_degC:0.1degC");
}
TEST(Reader, FahrenheitIsRecognisedAtTheAmbient) {
  says(complaint("time_s,current_A,housing_degC,ambient_degC\n0,1,70,70\n1,1,71,70\n"), "looks like Fahrenheit");
}
TEST(Reader, AMotorWarmerThanAnyRoomWithoutAnAmbientIsRefusedWithTheUnitItMayBe) {
  says(complaint(head + "0,1,70\n1,1,71\n"),
       "--ambient DEGC, or record it; if this is Fahrenheit say --column housing_degC=housing_degC:degF");
}
TEST(Reader, HousingAndWindingSwappedAreRecognised) {
  // A winding (2 s) on a housing (300 s), half a minute of load and rest by turns.
  std::string right = "time_s,current_A,housing_degC,core_degC\n",
              swapped = "time_s,current_A,core_degC,housing_degC\n";
  double core = 25, housing = 25;
  for (int i = 0; i < 600; ++i) {
    const double current = (i / 37) % 2 == 0 ? 3 : 0;
    for (std::string* text : {&right, &swapped}) {
      *text += std::to_string(i) + "," + std::to_string(current) + "," + std::to_string(housing) + "," +
               std::to_string(core) + "\n";
    }
    for (int k = 0; k < 10; ++k) {
      const double flow = core - housing;
      core += 0.1 * (current * current - flow) / 2;
      housing += 0.1 * (flow - (housing - 25) / 15) / 20;
    }
  }
  EXPECT_NO_THROW(read(right));
  says(complaint(swapped), "the two columns are swapped");
}
TEST(Reader, MilliampereIsRecognised) { says(complaint(head + "0,1500,20\n1,-2500,20\n"), "if it is in mA"); }
TEST(Reader, ImpossibleTemperaturesAreRefused) {
  says(complaint(head + "0,1,20\n1,1,9999\n"), "housing_degC reaches 9999");
}
TEST(Reader, RowsWithoutTimeAreRefusedWhenMany) {
  says(complaint(head + "0,1,20\n,1,20\n,1,20\n"), "2 of 3 rows have no time");
}
TEST(Reader, AnInputThatIsMostlyMissingIsRefused) {
  says(complaint(head + "0,1,20\n1,,20\n2,,20\n3,1,20\n"), "current_A is missing in 50 % of the rows");
}
TEST(Reader, MessagesThatCameOneARowAreJudgedByTheirOwnInterval) {
  std::string merged = head, torn = head;
  for (int i = 0; i < 300; ++i) {
    merged += std::to_string(0.1 * i) + (i % 3 == 0 ? ",2," : i % 3 == 1 ? ",,21" : ",,") + "\n";
    torn += std::to_string(0.1 * i) + ((i * 7919) % 13 < 5 ? ",2," : ",,") + "21\n";
  }
  EXPECT_LT(read(merged)[0].missing_share, 0.05);
  says(complaint(torn), "is missing in 6");
}
TEST(Reader, AColumnOfNothingCountsAsMissing) {
  says(complaint(head + "0,1,\n1,1,nan\n2,1,\n"), "no temperature");
  says(complaint(head + "0,,20\n1,nan,20\n2,,21\n"),
       "the heat input (current_A, iq_A, power_W or torque_Nm) has no value");
}
TEST(Reader, RowsOutsideOfEverySessionAreSaid) {
  const auto logs = read("session,time_s,current_A,housing_degC\n1,0,1,20\n,1,1,20\n1,2,1,21\n");
  ASSERT_EQ(logs.size(), 1u);
  says(logs[0].notes.back(), "1 rows without a session were left out");
}
/// Ten rows at rest, then a load; the winding read every third row.
std::string resistance_log(double ambient_degC, double rest_A, const char* columns = "current_A,winding_ohm,bus_V") {
  std::string text = std::string("time_s,housing_degC,ambient_degC,") + columns + "\n";
  for (int i = 0; i < 40; ++i) {
    text += std::to_string(i) + ",24.5," + std::to_string(ambient_degC) + "," + std::to_string(i < 10 ? rest_A : 3) +
            "," +
            (i % 3 != 0 ? ""
             : i < 10   ? "0.500"
                        : "0.600") +
            ",0\n";
  }
  return text;
}
TEST(Reader, AResistanceIsReadAsATemperatureFromAStartAtRest) {
  for (const char* columns : {"current_A,winding_ohm,bus_V", "power_W,winding_ohm,bus_V", "id_A,winding_ohm,iq_A"}) {
    const Log log = read(resistance_log(24, 0, columns))[0];
    EXPECT_NEAR(log.of(Role::core)[3], 24.5, 1e-9);
    EXPECT_NEAR(log.of(Role::core)[30], 20 + (1.2 * (1 + 0.00393 * 4.5) - 1) / 0.00393, 1e-6);
    EXPECT_TRUE(std::isnan(log.of(Role::core)[31])) << "a reading that was not taken";
    ASSERT_FALSE(log.notes.empty());
    says(log.notes.front(),
         "winding_ohm is read as core_degC by copper's 0.393 %/K, from 0.5 ohm at 24.5 degC at the start (4 readings)");
  }
}
TEST(Reader, AllReadingsOfAResistanceAtRestAreItsReferenceUntilSomethingTurns) {
  // Seven at rest, the fourth gone wrong.
  std::string text = "time_s,housing_degC,current_A,speed_rad_per_s,winding_ohm\n";
  for (int i = 0; i < 40; ++i)
    text += fmt::format("{},20,{},{},{}\n", i, i < 20 ? 0 : 3, i < 7 ? 0 : 100,
                        i == 3  ? 9.9
                        : i < 7 ? 1 + 0.01 * i
                                : 2);
  const Log log = read(text)[0];
  EXPECT_EQ(log.core_reference.readings, 7u);
  EXPECT_EQ(log.core_reference.degC, 20);
  EXPECT_NEAR(log.of(Role::core)[0], 20 + (1 / ((1.02 + 1.04 + 1.05) / 3) - 1) / 0.00393, 1e-9) << "the middle three";
}
TEST(Reader, RestIsSeenThroughTheNoiseOfACurrentAndThroughRowsThatDoNotTellIt) {
  // Every other row tells the current, of 10 A at most; at rest it is off by 0.4 A twice running, and then by 2 A.
  const auto readings = [](double later_A) {
    std::string text = "time_s,housing_degC,current_A,winding_ohm\n";
    for (int i = 0; i < 60; ++i) {
      const double amps = i >= 50 ? 10 : i == 10 || i == 12 ? 0.4 : i == 30 ? later_A : 0;
      text += fmt::format("{},20,{},{}\n", i, i % 2 == 0 ? fmt::format("{}", amps) : "", i % 10 == 5 ? "1" : "");
    }
    return read(text)[0].core_reference.readings;
  };
  EXPECT_EQ(readings(0), 5u) << "in rows 5, 15, ... 45";
  EXPECT_EQ(readings(2), 3u) << "a load, however short";
}
TEST(Reader, AResistanceOfNothingIsNoReading) {
  std::string text = resistance_log(24, 0);
  text.replace(text.find("0.500"), 5, "0");
  const Log log = read(text)[0];
  EXPECT_TRUE(std::isnan(log.of(Role::core)[0]));
  EXPECT_NEAR(log.of(Role::core)[3], 24.5, 1e-9);
  says(log.notes.front(), "Cells of winding_ohm that say 0 or less are taken for no reading: 1.");
}
TEST(Reader, AResistanceWhoseTemperatureIsKnownAtNoMomentIsSaidNotToBeUsed) {
  for (const std::string& text : {resistance_log(20, 0), resistance_log(24, 3)}) {
    const Log log = read(text)[0];
    EXPECT_FALSE(log.has(Role::core));
    says(log.notes.front(), "winding_ohm is not used");
    says(log.notes.front(), "begin the log at rest");
  }
}
TEST(Reader, ColumnsThatNothingIsMadeOfAreSaidTogether) {
  const Log log = read(
      "time_s,current_A,housing_degC,bus_V,board_degC,id_A,core_degC,winding_ohm\n"
      "0,1,20,24,30,0,20,1\n1,1,21,24,30,0,20,1\n")[0];
  ASSERT_EQ(log.notes.size(), 1u);
  says(log.notes[0], "bus_V, board_degC, winding_ohm, id_A are not used");
  EXPECT_TRUE(read(head + "0,1,20\n1,1,21\n")[0].notes.empty());
}
TEST(Reader, ACurrentBesideAPowerIsSaidNotToBeTheHeat) {
  const Log log = read("time_s,power_W,current_A,iq_A,housing_degC\n0,1,1,1,20\n1,1,1,1,21\n")[0];
  ASSERT_EQ(log.notes.size(), 1u);
  says(log.notes[0], "power_W is taken for the heat, and not current_A, iq_A");
}
TEST(Reader, AFileThatIsNotThereIsAUsageError) {
  try {
    identify::read_table("no/such/log.csv");
    FAIL();
  } catch (const UserError& error) {
    EXPECT_EQ(error.exit_code(), 2);
    says(error.what(), "there is no such file");
  }
}

TEST(Map, AMisspeltRoleIsAnsweredWithTheNearest) {
  ColumnMap map;
  try {
    identify::add_column(map, "housing_C=T");
    FAIL();
  } catch (const UserError& error) {
    EXPECT_EQ(error.exit_code(), 2);
    says(error.what(), "did you mean 'housing_degC'?");
  }
}
TEST(Map, UnitsAreKnownAsLoggersSpellThem) {
  const auto factor = [](const std::string& role, const std::string& unit) {
    ColumnMap map;
    identify::add_column(map, role + "=x:" + unit);
    const identify::Source source = map.columns.begin()->second;
    EXPECT_TRUE(source.unit_said) << unit;
    return source.factor;
  };
  for (const char* rpm : {"RPM", "Rpm", "rpm", "1/min", "min-1"})
    EXPECT_NEAR(factor("speed_rad_per_s", rpm), 0.104719755, 1e-9);
  EXPECT_NEAR(factor("speed_rad_per_s", "rev/s"), 6.283185307, 1e-9);
  for (const char* turns : {"turns/s", "turn/s"}) EXPECT_EQ(factor("speed_rad_per_s", turns), 2 * M_PI);
  for (const char* deg : {"deg_s", "dps"}) EXPECT_EQ(factor("speed_rad_per_s", deg), M_PI / 180);
  EXPECT_EQ(identify::unit_in_name("/Drive/VelocityRadPerSec", "speed_rad_per_s"), "RadPerSec");
  EXPECT_EQ(factor("speed_rad_per_s", "RotPerSec"), 2 * M_PI);
  for (const char* rad : {"rad_s", "rad.s-1"}) EXPECT_EQ(factor("speed_rad_per_s", rad), 1);
  for (const char* mNm : {"N.mm", "Nmm", "N·mm"}) EXPECT_EQ(factor("torque_Nm", mNm), 1e-3);
  EXPECT_EQ(factor("current_A", "ma"), 1e-3);
  EXPECT_EQ(factor("time_s", "ns"), 1e-9);
  for (const char* us : {"us", "µs", "μs"}) EXPECT_EQ(factor("time_s", us), 1e-6);
  for (const char* mohm : {"mohm", "mΩ", "mΩ"}) EXPECT_EQ(factor("winding_ohm", mohm), 1e-3);
  for (const char* degC : {"Deg C", "degC", "deg c", "Celsius", "celsius", "ºC", "°C", "C"})
    EXPECT_EQ(factor("housing_degC", degC), 1);
  for (const char* degF : {"Deg F", "DEGF", "Fahrenheit", "ºF", "°F", "F"})
    EXPECT_NEAR(factor("housing_degC", degF), 0.5555555556, 1e-9);
  for (const char* none : {"rad.s", "MA", "c", "f", "S", ""}) EXPECT_FALSE(identify::unit_named(none)) << none;
}
TEST(Map, AUnitOfAnotherQuantityIsRefused) {
  ColumnMap map;
  EXPECT_THROW(identify::add_column(map, "speed_rad_per_s=n:degF"), UserError);
}

TEST(Masks, AFrozenStretchOfAMovingChannelIsFound) {
  std::vector<double> v;
  for (int i = 0; i < 400; ++i) v.push_back(20 + 0.013 * i + 0.1 * ((i * 7919) % 13));
  for (int i = 150; i < 190; ++i) v[static_cast<std::size_t>(i)] = v[150];
  const auto runs = identify::frozen_runs(v);
  ASSERT_EQ(runs.size(), 1u);
  EXPECT_EQ(runs[0].first, 150u);
  EXPECT_EQ(runs[0].second, 190u);
}
TEST(Masks, AFineChannelThatTurnsRoundIsNotFrozen) {
  std::vector<double> v;
  for (int i = 0; i < 800; ++i) v.push_back(0.06 * std::round((20 + 30 * std::sin(i / 250.0)) / 0.06));
  EXPECT_TRUE(identify::frozen_runs(v).empty());
}
TEST(Masks, ACoarseOrConstantChannelIsNotFrozen) {
  EXPECT_TRUE(identify::frozen_runs(std::vector<double>(500, 25.0)).empty());
  std::vector<double> coarse;
  for (int i = 0; i < 2000; ++i) coarse.push_back(20 + 0.5 * std::floor(10 * (1 - std::exp(-i / 300.0)) / 0.5));
  EXPECT_TRUE(identify::frozen_runs(coarse).empty());
}
TEST(Masks, ASensorOfWholeDegreesIsReadAsItSteps) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  const auto truth_degC = [](double t) { return 25 + 12 * std::sin(t / 60); };  // one degree in five seconds at most
  const auto log_of = [&](double step_K, double noise_K, double hurry) {
    std::string text = head;
    for (int i = 0; i < 6000; ++i) {
      const double told_degC = step_K * std::round((truth_degC(0.1 * i * hurry) + noise_K * normal(random)) / step_K);
      text += std::to_string(0.1 * i) + ",1," + std::to_string(told_degC) + "\n";
    }
    return read(text)[0];
  };
  for (const double noise_K : {0.0, 0.05, 0.2, 0.4}) {
    const Log log = log_of(1, noise_K, 1);
    EXPECT_EQ(log.housing_step_K, 1);
    double sum = 0, readings = 0;
    for (std::size_t i = 0; i < 6000; ++i) {
      const double degC = log.of(Role::housing)[i];
      if (std::isnan(degC)) continue;
      sum += std::pow(degC - truth_degC(log.of(Role::time)[i]), 2);
      readings += 1;
    }
    EXPECT_GT(readings, 60);
    EXPECT_LT(std::sqrt(sum / readings), 0.15) << noise_K << ": what is believed of such a reading";
    ASSERT_FALSE(log.notes.empty());
    says(log.notes.back(), "moves in steps of 1 K");
  }
  EXPECT_EQ(log_of(0.1, 0, 1).housing_step_K, 0) << "fine steps";
  EXPECT_EQ(log_of(1, 0, 30).housing_step_K, 0) << "six degrees a second";
}
TEST(Masks, AFlutterAboutOneDegreeIsOneStepHoweverLongItLasts) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  const auto truth_degC = [](double t) { return 25 + 12 * std::sin(t / 1900); };  // a degree in 160 s at the fastest
  for (const double noise_K : {0.05, 0.1, 0.2}) {
    std::string text = head;
    for (int t = 0; t < 23876; t += 2)  // two periods
      text += std::to_string(t) + ",1," + std::to_string(std::round(truth_degC(t) + noise_K * normal(random))) + "\n";
    const Log log = read(text)[0];
    ASSERT_EQ(log.housing_step_K, 1) << noise_K;
    int readings = 0;
    for (std::size_t i = 0; i < log.of(Role::time).size(); ++i) {
      const double degC = log.of(Role::housing)[i];
      if (std::isnan(degC)) continue;
      EXPECT_NEAR(degC, truth_degC(log.of(Role::time)[i]), 3 * 0.15) << noise_K;
      ++readings;
    }
    EXPECT_NEAR(readings, 4 * 24, 10) << noise_K << ": each step up and down, twice";
  }
}
TEST(Masks, RowsMissingOneByOneAreCounted) {
  std::string text = head;
  for (int i = 0; i < 400; ++i) {
    if (i * 7919 % 10 >= 4) text += std::to_string(0.1 * i) + ",1," + std::to_string(20 + i % 7) + "\n";
  }
  const Log log = read(text)[0];
  EXPECT_NEAR(log.missing_share, 0.4, 0.05);
}
TEST(Masks, GapsInTimeAreCounted) {
  std::string text = head;
  for (int i = 0; i < 100; ++i)
    text += std::to_string(0.1 * (i < 50 ? i : i + 40)) + ",1," + std::to_string(20 + i % 7) + "\n";
  const Log log = read(text)[0];
  EXPECT_NEAR(log.gap_share, 40.0 / 139, 0.01);
  ASSERT_FALSE(log.notes.empty());
  says(log.notes.back(), "1 gap in time");
}

/// A noisy housing read every `every` rows of 0.1 s, what lies between as `between` makes it of what was read before
/// and after and of the share of the way; rounded to `step_K`.
Log filled_in(int every, const std::function<double(double, double, double)>& between, double step_K,
              double noise_K = 0.2) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, noise_K);
  std::string text = head;
  double before = 20, after = 20;
  for (int i = 0; i < 3000; ++i) {
    if (i % every == 0) before = after, after = 25 + 10 * std::sin((i + every) / 900.0) + noise(random);
    double told = between(before, after, static_cast<double>(i % every) / every);
    if (step_K > 0) told = step_K * std::round(told / step_K);
    char row[64];
    std::snprintf(row, sizeof row, "%.1f,1,%.12g\n", 0.1 * i, told);
    text += row;
  }
  return read(text)[0];
}
double hold(double before, double, double) { return before; }
double line(double before, double after, double share) { return before + share * (after - before); }

std::vector<std::size_t> rows_read(const Log& log) {
  std::vector<std::size_t> out;
  const auto& v = log.of(Role::housing);
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (!std::isnan(v[i])) out.push_back(i);
  }
  return out;
}

TEST(Filled, AHeldReadingCountsOnce) {
  for (const int every : {2, 10, 50}) {
    for (const double step_K : {0.0, 0.1}) {
      const Log log = filled_in(every, hold, step_K);
      const auto rows = rows_read(log);
      EXPECT_EQ(rows.size(), 3000u / static_cast<std::size_t>(every)) << every << " " << step_K;
      for (const std::size_t row : rows) EXPECT_EQ(row % static_cast<std::size_t>(every), 0u) << every;
      ASSERT_FALSE(log.notes.empty());
      says(log.notes.front(), "housing_degC was filled in by repeating");
    }
  }
}
TEST(Filled, BetweenReadingsJoinedByLinesNothingWasRead) {
  for (const int every : {2, 10, 50}) {
    for (const double step_K : {0.0, 0.001, 0.01}) {
      const Log log = filled_in(every, line, step_K);
      const auto rows = rows_read(log);
      EXPECT_NEAR(static_cast<double>(rows.size()), 3000.0 / every, 0.15 * 3000 / every) << every << " " << step_K;
      // Where a line bends by less than the rounding, its end is up to a fifth of it off.
      const auto off = std::count_if(rows.begin(), rows.end(), [&](std::size_t row) {
        const double read = std::round(static_cast<double>(row) / every) * every;
        return std::abs(static_cast<double>(row) - read) > every / 5;
      });
      EXPECT_LT(off, 0.05 * static_cast<double>(rows.size())) << every << " " << step_K;
      ASSERT_FALSE(log.notes.empty());
      says(log.notes.front(), "housing_degC was filled in along straight lines");
    }
  }
}
TEST(Filled, EveryRowOfANoisyASmoothOrAQuietChannelWasRead) {
  for (const double noise_K : {0.0, 0.005, 0.05, 0.2}) {
    for (const double step_K : {0.0, 0.01, 0.0625, 0.1}) {
      const Log log = filled_in(1, hold, step_K, noise_K);
      for (const std::string& note : log.notes)
        EXPECT_EQ(note.find("filled in"), std::string::npos) << note << noise_K << " " << step_K;
    }
  }
}
TEST(Filled, ACommandedCurrentIsWhatFlowed) {
  std::string text = head;
  for (int i = 0; i < 3000; ++i)
    text += std::to_string(0.1 * i) + "," + std::to_string(i / 50 * 7 % 5) + "," + std::to_string(20 + i % 7) + "\n";
  const Log log = read(text)[0];
  EXPECT_EQ(identify::without_lines(log, Role::current), log.of(Role::current));
}

/// A row a second of a measured current and a housing that warms.
std::string recording(int rows, const std::function<bool(int, double&, double&)>& kept) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 0.01);
  std::string text = head;
  for (int i = 0; i < rows; ++i) {
    double current_A = 2 + noise(random), housing_degC = 20 + 0.05 * i + noise(random);
    if (!kept(i, current_A, housing_degC)) continue;
    text += std::to_string(i) + "," + (std::isnan(current_A) ? "" : std::to_string(current_A)) + "," +
            std::to_string(housing_degC) + "\n";
  }
  return text;
}

TEST(Masks, ReadingsThatJumpAwayAndBackAreGlitches) {
  for (const double reads : {85.0, -127.0, 0.0}) {
    const Log log = read(recording(200, [&](int i, double&, double& housing_degC) {
      if (i == 0 || i == 40 || (i >= 90 && i < 93) || i == 199) housing_degC = reads;
      return true;
    }))[0];
    const auto& housing = log.of(Role::housing);
    for (const double x : housing) EXPECT_TRUE(std::isnan(x) || (x > 19 && x < 31)) << x;
    EXPECT_EQ(std::count_if(housing.begin(), housing.end(), [](double x) { return std::isnan(x); }), 6);
    says(log.notes.front(), "6 readings masked, the first at 0.0 s");
  }
}
TEST(Masks, WhatALoggerWritesForWantOfAReadingIsNone) {
  const Log log = read(recording(200, [&](int i, double&, double& housing_degC) {
    if (i % 10 != 0) housing_degC = -1;
    return true;
  }))[0];
  EXPECT_EQ(identify::count_told(log.of(Role::housing)), 20u);
  says(fmt::format("{}", fmt::join(log.notes, " ")), "housing_degC leaps to -1 and back; that stands for no reading");
}
TEST(Masks, AWindingThatIsHotForSecondsIsNoGlitchAndOneColderThanItsRoomIs) {
  std::string text = "time_s,current_A,core_degC,ambient_degC\n";
  for (int i = 0; i < 60; ++i)
    text +=
        std::to_string(i) + ",1," + std::to_string(i == 40 ? 0 : 20 + 60 * std::exp(-std::abs(i - 20) / 3.0)) + ",20\n";
  const auto core = read(text)[0].of(Role::core);
  EXPECT_DOUBLE_EQ(core[20], 80);
  EXPECT_TRUE(std::isnan(core[40]));
}
TEST(Masks, OneRowOfManyTimesTheCurrentIsAGlitchAndTwoRowsAreNone) {
  const auto current = [](int rows) {
    const std::string text = recording(200, [&](int i, double& current_A, double&) {
      if (i >= 50 && i < 50 + rows) current_A = 99;
      return true;
    });
    return read(text)[0].of(Role::current)[50];
  };
  EXPECT_TRUE(std::isnan(current(1)));
  EXPECT_EQ(current(2), 99);
}

TEST(Pauses, AfterAShortOneTheLogGoesOnAndAfterALongOneAnotherBegins) {
  const auto paused = [](int until) {
    return read(recording(until + 200, [&](int i, double&, double&) { return i < 200 || i >= until; }));
  };
  const auto one = paused(300);
  ASSERT_EQ(one.size(), 1u);
  EXPECT_EQ(one[0].of(Role::time).back(), 499);
  EXPECT_EQ(one[0].resumes_s, std::vector<double>{300});
  EXPECT_EQ(one[0].gap_share, 0) << "nothing is held across it";
  says(one[0].notes.back(), "Nothing tells the heat input for 101 s from 199 s");
  const auto two = paused(900);
  ASSERT_EQ(two.size(), 2u);
  EXPECT_EQ(two[0].of(Role::time).back(), 199);
  EXPECT_EQ(two[1].of(Role::time).front(), 0);
  EXPECT_EQ(two[1].of(Role::time).back(), 199);
  says(two[1].name, "(from 900 s)");
  // Both in the same room, though one began warm and no room was recorded.
  EXPECT_EQ(two[1].of(Role::ambient), two[0].of(Role::ambient));
}
TEST(Pauses, ARoomThatWasTypedOnceIsThatOfEveryPart) {
  std::string text = "time_s,current_A,housing_degC,ambient_degC\n";
  for (int i = 0; i < 1200; ++i) {
    if (i < 200 || i >= 1000)
      text += std::to_string(i) + ",2," + std::to_string(20 + 0.03 * i) + (i == 0 ? ",19\n" : ",\n");
  }
  const auto logs = read(text);
  ASSERT_EQ(logs.size(), 2u);
  EXPECT_EQ(logs[1].of(Role::ambient).front(), 19);
}
TEST(Pauses, WhatIsSoOfALogIsSoOfItsParts) {
  std::string text = "t,torque_Nm,housing_degC,velocity\n";
  for (int i = 0; i < 1200; ++i) {
    if (i < 200 || i >= 1000) text += fmt::format("{},2,{},{}\n", i, 20 + 0.03 * i, i % 9);
  }
  ColumnMap map;
  map.ambient_degC = 19;
  add_column(map, "speed_rad_per_s=velocity");
  const auto logs = read(text, map);
  ASSERT_EQ(logs.size(), 2u);
  for (const Log& log : logs) {
    EXPECT_TRUE(log.torque_for_A) << "took newton metres for amperes";
    EXPECT_TRUE(log.sink_typed);
    EXPECT_TRUE(log.speed_guessed);
    EXPECT_EQ(identify::column_in(log, Role::time, "ms"), "--column time_s=t:ms");
  }
  ColumnMap said;
  add_column(said, "speed_rad_per_s=velocity:rev/s");
  EXPECT_FALSE(read(text, said)[0].speed_guessed);
}
TEST(Pauses, ACurrentThatIsNotWrittenForAWhileIsOneAlsoAtTheEnd) {
  const auto logs = read(recording(400, [](int i, double& current_A, double&) {
    if ((i >= 100 && i < 200) || i >= 340) current_A = std::nan("");
    return true;
  }));
  ASSERT_EQ(logs.size(), 1u);
  EXPECT_EQ(logs[0].resumes_s, std::vector<double>{200});
  EXPECT_EQ(logs[0].of(Role::time).size(), 240u);
  EXPECT_EQ(logs[0].missing_share, 0);
}
TEST(Pauses, AMeasuredCurrentThatStandsStillUnderLoadIsOne) {
  const auto stands = [](const std::function<double(int, double)>& current) {
    return read(recording(400,
                          [&](int i, double& current_A, double&) {
                            current_A = current(i, current_A - 2);
                            return true;
                          }))[0]
        .resumes_s.size();
  };
  const auto held = [](int i) { return i >= 200 && i < 300; };
  EXPECT_EQ(stands([&](int i, double noise) { return held(i) ? 1.4321 : 2 + noise; }), 1u);
  EXPECT_EQ(stands([&](int i, double noise) { return held(i) ? 0.02 : 2 + noise; }), 0u) << "an offset at rest";
  EXPECT_EQ(stands([&](int i, double) { return held(i) ? 1.4321 : 0.01 * i; }), 0u) << "a commanded ramp";
  EXPECT_EQ(stands([&](int i, double) { return held(i) ? 1.4321 : i % 2 * 3.0; }), 0u) << "commanded pulses";
  EXPECT_EQ(stands([&](int i, double noise) { return held(i) ? 1.4 : 0.1 * std::round(20 + 3 * noise); }), 0u)
      << "a coarse current";
}
TEST(Pauses, AMeasuredCurrentThatStandsStillNearRestIsOnlySaid) {
  const auto notes = [](double rest_A, bool measured) {
    const auto log = read(recording(400, [&](int i, double& current_A, double&) {
      if (!measured) current_A = 2;
      if (i >= 300) current_A = rest_A;
      return true;
    }))[0];
    EXPECT_TRUE(log.resumes_s.empty());
    return fmt::format("{}", fmt::join(log.notes, " "));
  };
  says(notes(0.02, true), "current_A stands still at 0.02 for 99 s from 300 s; if it was not measured there");
  EXPECT_EQ(notes(0, true).find("stands"), std::string::npos) << "switched off";
  EXPECT_EQ(notes(0.02, false).find("stands"), std::string::npos) << "commanded";
}
TEST(Pauses, ALoggerThatWritesSeldomAtRestMakesNone) {
  const auto logs = read(recording(2000, [](int i, double&, double&) { return i / 200 % 4 != 3 || i % 10 == 0; }));
  ASSERT_EQ(logs.size(), 1u);
  EXPECT_TRUE(logs[0].resumes_s.empty());
}
TEST(Pauses, OfManyTheLongestCount) {
  const auto logs = read(recording(6000, [](int i, double&, double&) { return i % 200 >= (i < 3000 ? 10 : 20); }));
  ASSERT_EQ(logs.size(), 1u);
  EXPECT_EQ(logs[0].resumes_s.size(), 24u);
  EXPECT_GT(logs[0].resumes_s[23], 5800);
}
TEST(Pauses, OneRowAloneInOneEndsItNot) {
  const auto log = read(recording(600, [](int i, double&, double&) { return i < 200 || i == 260 || i >= 320; }))[0];
  EXPECT_EQ(log.resumes_s, (std::vector<double>{260, 320}));
}
TEST(Pauses, ManyCurrentsThatStandStillDoNotHideEachOther) {
  const auto log = read(recording(2000, [](int i, double& current_A, double&) {
    if (i % 200 >= 110) current_A = 1.4321;
    return true;
  }))[0];
  EXPECT_EQ(log.resumes_s.size(), 9u);
}
TEST(Pauses, OfACurrentInOtherRowsThanTheFirstTheyAreNoHole) {
  std::string text = "time_s,iq_A,id_A,housing_degC\n";
  for (int i = 0; i < 1000; ++i) {
    if (i < 300 || i >= 700)
      text += std::to_string(i) + (i % 2 == 0 ? ",2,," : ",,0.1,") + std::to_string(20 + 0.03 * i + i % 3) + "\n";
  }
  EXPECT_LT(read(text)[0].missing_share, 0.1);
}
TEST(Pauses, WhatIsTooShortBetweenLongOnesIsLeftOutAndSaid) {
  const auto logs = read(recording(2000, [](int i, double&, double&) { return i < 150 || i / 20 == 50 || i >= 1800; }));
  ASSERT_EQ(logs.size(), 2u);
  says(logs[0].notes.back(), "19 s between pauses of more than ten minutes are left out");
}

}  // namespace
