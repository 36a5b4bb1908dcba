// SPDX-License-Identifier: GPL-2.0-only
#pragma once

#include "Radios.h"

#include <map>
#include <omnetpp.h>
#include <string>
#include <traci/BasicNodeManager.h>

namespace advpipe
{

/// See NodeManager.ned. The records are those of advpipe's `pipeline/artery/records.py`.
class NodeManager : public traci::BasicNodeManager
{
public:
    NodeManager();
    ~NodeManager() override;

    using traci::Listener::receiveSignal;
    void receiveSignal(omnetpp::cComponent*, omnetpp::simsignal_t, long, omnetpp::cObject*) override;
    void receiveSignal(omnetpp::cComponent*, omnetpp::simsignal_t, omnetpp::cObject*, omnetpp::cObject*) override;

protected:
    void initialize() override;
    void finish() override;
    void handleMessage(omnetpp::cMessage*) override;
    void traciInit() override;
    void traciStep() override;
    void addVehicle(const std::string& id) override;
    void removeVehicle(const std::string& id) override;

private:
    void handedToRadio(omnetpp::cComponent* mac, omnetpp::cObject* frame);
    double transmitPowerDbm(omnetpp::cModule* host) const;

    Link mLink;
    Radios mRadios;
    omnetpp::cMessage* mTick = nullptr;
    omnetpp::simtime_t mStep;
    double mSumoOffset = 0.0; ///< s, from Artery's time to SUMO's
    bool mHasBegun = false;
    std::map<std::string, omnetpp::simtime_t> mWaiting; ///< vehicles without a station so far, and when they get it
};

} // namespace advpipe
