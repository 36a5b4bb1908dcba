// SPDX-License-Identifier: GPL-2.0-only
#pragma once

#include <cstdint>
#include <string>

namespace advpipe
{

/// One record for advpipe: its kind, then numbers (little-endian) and strings (UTF-8, 16-bit length first).
class Record
{
public:
    explicit Record(char kind) : mBytes(1, kind) {}
    Record& number(std::uint64_t value, unsigned bytes);
    Record& real(double value);
    Record& text(const std::string&);
    Record& rest(const std::string& bytes) { mBytes += bytes; return *this; }
    const std::string& bytes() const { return mBytes; }

private:
    std::string mBytes;
};

/// Takes a record from advpipe apart: its numbers in order, then the rest.
class RecordReader
{
public:
    explicit RecordReader(const std::string& record) : mBytes(record) {}
    char kind() const { return mBytes.at(0); }
    std::uint64_t number(unsigned bytes);
    double real();
    std::string rest() const { return mBytes.substr(mPlace); }

private:
    const std::string& mBytes;
    std::size_t mPlace = 1;
};

/// The TCP connection to advpipe. Records are buffered until `flush`; errors throw omnetpp::cRuntimeError.
class Link
{
public:
    ~Link();
    void open(const char* host, int port);
    void write(const Record&);
    void flush();
    std::string ask(const Record&); ///< waits for the answer: a byte with its length, then its text
    std::string read(); ///< waits for a record: four bytes with its length, then its bytes

private:
    void receive(char* into, std::size_t bytes);

    int mSocket = -1;
    std::string mBuffer;
};

} // namespace advpipe
