using UnityEngine;

namespace Gsac
{
    /// <summary>Buttons for an avatar, and a camera that the mouse turns about it (left button; wheel for distance).</summary>
    [AddComponentMenu("Gsac/Gsac Demo")]
    public sealed class GsacDemo : MonoBehaviour
    {
        [SerializeField] GsacAvatar avatar = null;
        [SerializeField, Tooltip("Where no avatar is named: the first of these.")] GsacCast cast = null;
        [SerializeField] Camera eye = null;

        float yaw = 180;
        float pitch = 8;
        float distance = 3.2f;
        int expression;
        float weight;

        void Start()
        {
            if (avatar == null && cast != null) avatar = cast.First;
            if (avatar != null && avatar.Data.Clips.Count > 0) avatar.Source = GsacSource.Clip;
        }

        void OnGUI()
        {
            if (avatar == null || eye == null) return;
            GUILayout.BeginArea(new Rect(10, 10, 220, 600));
            foreach (string pose in avatar.Data.Poses.Keys)
            {
                if (GUILayout.Button(pose + "-pose")) avatar.ShowPose(pose);
            }
            foreach (string clip in avatar.Data.Clips.Keys)
            {
                if (GUILayout.Button(clip)) avatar.PlayClip(clip);
            }
            string[] names = avatar.Data.Expressions;
            if (names.Length > 0)
            {
                expression %= names.Length; // another person may have fewer
                GUILayout.Label(names[expression]);
                float chosen = GUILayout.HorizontalSlider(weight, 0, 1);
                if (GUILayout.Button("next expression"))
                {
                    avatar.SetExpression(names[expression], weight = chosen = 0);
                    expression = (expression + 1) % names.Length;
                }
                if (chosen != weight) avatar.SetExpression(names[expression], weight = chosen);
            }
            GUILayout.EndArea();
            Turn(Event.current);
        }

        void Turn(Event e)
        {
            if (e.type == EventType.MouseDrag && e.mousePosition.x > 230)
            {
                yaw += e.delta.x * 0.3f;
                pitch = Mathf.Clamp(pitch + e.delta.y * 0.3f, -80, 80);
            }
            if (e.type == EventType.ScrollWheel) distance = Mathf.Clamp(distance * Mathf.Exp(e.delta.y * 0.05f), 0.4f, 20);
        }

        void LateUpdate()
        {
            if (avatar == null || eye == null) return;
            Quaternion turn = Quaternion.Euler(pitch, yaw, 0);
            Vector3 centre = avatar.transform.position + new Vector3(0, 0.9f, 0);
            eye.transform.SetPositionAndRotation(centre - turn * Vector3.forward * distance, turn);
        }
    }
}
