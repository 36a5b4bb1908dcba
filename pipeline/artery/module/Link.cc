// SPDX-License-Identifier: GPL-2.0-only
#include "Link.h"

#include <arpa/inet.h>
#include <cerrno>
#include <cstring>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <omnetpp/cexception.h>
#include <sys/socket.h>
#include <unistd.h>

using omnetpp::cRuntimeError;

namespace advpipe
{

Record& Record::number(std::uint64_t value, unsigned bytes)
{
    for (unsigned i = 0; i < bytes; ++i) {
        mBytes.push_back(static_cast<char>(value >> 8 * i & 0xff));
    }
    return *this;
}

Record& Record::real(double value)
{
    static_assert(sizeof(double) == 8, "IEEE 754");
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    return number(bits, 8);
}

Record& Record::text(const std::string& text)
{
    number(text.size(), 2);
    return rest(text);
}

std::uint64_t RecordReader::number(unsigned bytes)
{
    if (mPlace + bytes > mBytes.size()) {
        throw cRuntimeError("advpipe sent a record '%c' that is too short", kind());
    }
    std::uint64_t value = 0;
    for (unsigned i = 0; i < bytes; ++i) {
        value |= static_cast<std::uint64_t>(static_cast<unsigned char>(mBytes[mPlace++])) << 8 * i;
    }
    return value;
}

double RecordReader::real()
{
    const std::uint64_t bits = number(8);
    double value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
}

Link::~Link()
{
    if (mSocket >= 0) {
        close(mSocket);
    }
}

void Link::open(const char* host, int port)
{
    sockaddr_in address {};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    if (inet_pton(AF_INET, host, &address.sin_addr) != 1) {
        throw cRuntimeError("advpipe: %s is no IPv4 address", host);
    }
    mSocket = socket(AF_INET, SOCK_STREAM, 0);
    if (mSocket < 0 || connect(mSocket, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
        throw cRuntimeError("advpipe does not listen at %s:%d (%s)", host, port, std::strerror(errno));
    }
    const int on = 1;
    setsockopt(mSocket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

void Link::write(const Record& record)
{
    const auto size = record.bytes().size();
    for (unsigned i = 0; i < 4; ++i) {
        mBuffer.push_back(static_cast<char>(size >> 8 * i & 0xff));
    }
    mBuffer += record.bytes();
    if (mBuffer.size() > 65536) {
        flush();
    }
}

void Link::flush()
{
    for (std::size_t sent = 0; sent < mBuffer.size();) {
        const auto n = send(mSocket, mBuffer.data() + sent, mBuffer.size() - sent, MSG_NOSIGNAL);
        if (n < 0 && errno != EINTR) {
            throw cRuntimeError("advpipe has closed the connection (%s)", std::strerror(errno));
        }
        sent += n > 0 ? n : 0;
    }
    mBuffer.clear();
}

std::string Link::ask(const Record& question)
{
    write(question);
    flush();
    char length = 0;
    receive(&length, 1);
    std::string answer(static_cast<unsigned char>(length), '\0');
    receive(&answer[0], answer.size());
    return answer;
}

std::string Link::read()
{
    std::string length(4, '\0');
    receive(&length[0], length.size());
    std::string record(RecordReader("U" + length).number(4), '\0');
    if (record.empty()) {
        throw cRuntimeError("advpipe sent an empty record");
    }
    receive(&record[0], record.size());
    return record;
}

void Link::receive(char* into, std::size_t bytes)
{
    while (bytes > 0) {
        const auto n = recv(mSocket, into, bytes, 0);
        if (n == 0 || (n < 0 && errno != EINTR)) {
            throw cRuntimeError("advpipe has closed the connection");
        }
        into += n > 0 ? n : 0;
        bytes -= n > 0 ? n : 0;
    }
}

} // namespace advpipe
