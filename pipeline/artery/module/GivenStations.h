// SPDX-License-Identifier: GPL-2.0-only
#pragma once

#include "Radios.h"

#include <map>
#include <omnetpp.h>
#include <string>
#include <unordered_map>

namespace advpipe
{

/// See GivenStations.ned. The records are those of advpipe's `pipeline/artery/given_records.py`.
class GivenStations : public omnetpp::cSimpleModule, public omnetpp::cListener
{
public:
    GivenStations();
    ~GivenStations() override;

    using omnetpp::cListener::receiveSignal;
    void receiveSignal(omnetpp::cComponent*, omnetpp::simsignal_t, omnetpp::cObject*, omnetpp::cObject*) override;

protected:
    void initialize() override;
    void handleMessage(omnetpp::cMessage*) override;

private:
    void obey(const std::string& record);
    void place(RecordReader&);
    void remove(std::uint32_t station);
    void send(RecordReader&);
    omnetpp::cModule* submodule(std::uint32_t station, const char* name) const;

    Link mLink;
    Radios mRadios;
    omnetpp::cMessage* mTick = nullptr;
    std::map<std::uint32_t, omnetpp::cModule*> mStations;
    std::unordered_map<long, std::uint64_t> mNumbers; ///< advpipe's, by ids of packets
    int mPlaced = 0;
};

} // namespace advpipe
