// Stands for Unity's immediate GUI. API.md: pages and versions.
namespace UnityEngine
{
    public enum EventType { MouseDrag = 3, ScrollWheel = 6 }

    public sealed class Event
    {
        public static Event current { get; internal set; } = new Event();
        public EventType type { get; set; }
        public Vector2 mousePosition { get; set; }
        public Vector2 delta { get; set; }
    }

    public sealed class GUILayoutOption { }

    public static class GUILayout
    {
        public static void Label(string text, params GUILayoutOption[] options) { }
        public static bool Button(string text, params GUILayoutOption[] options) { return text == Player.Pressed; }
        public static float HorizontalSlider(float value, float leftValue, float rightValue, params GUILayoutOption[] options) { return value; }
        public static void BeginArea(Rect screenRect) { }
        public static void EndArea() { }
    }

    public sealed class GUIStyle { }
}
