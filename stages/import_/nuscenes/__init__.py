"""nuScenes: tables of JSON and key frames."""
